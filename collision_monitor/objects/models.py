"""Containing models: a coarser, cheaper shape around an object, and a bound on how far it exceeds the object.

(Slides "Bounding objects": test the bounding objects first. Here the coarse result is also reported, with its error.)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.errors import InputError, ShapeError, UnsupportedError
from collision_monitor.geometry.bounding_spheres import minimal_sphere
from collision_monitor.geometry.bounding_volumes import KDOP_DIRECTIONS
from collision_monitor.geometry.coordinates import coordinates
from collision_monitor.geometry.oriented_boxes import obb_minimum_volume
from collision_monitor.geometry.qhull import QhullResult
from collision_monitor.objects.closed_parts import separated
from collision_monitor.objects.convex_decomposition import convex_decomposition
from collision_monitor.objects.excess import MANY_FACES, PosedShapes, enclosing_points, excess_of, excess_of_large
from collision_monitor.records import Model
from collision_monitor.shapes.cells.tiled_solid import TiledSolid
from collision_monitor.shapes.convex_pieces import convex_pieces, is_concave_mesh
from collision_monitor.shapes.planar import is_planar
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.reach import reach
from collision_monitor.shapes.registry import Box, ConvexHull, HalfSpace, Mesh, Points, Shape, Sphere, Triangle, kind_of
from collision_monitor.tolerances import ROUNDED_UP

Array = NDArray[np.float64]

MOST_DIRECTIONS: Final = 200
"""Most directions of a user's k-DOP; its polytope has up to four corners for each."""

KDOPS: Final = {Model.KDOP6: 6, Model.KDOP14: 14, Model.KDOP18: 18, Model.KDOP26: 26}

MODEL_NAMES: Final = tuple(m.name.lower() for m in Model)
"""Names of all models."""


class Modelled(NamedTuple):
    """Model of an object: convex pieces with their poses in its frame, the kind of model, and its excess (m).

    The model contains the object, and no point of the model is farther than the excess from the object.
    """

    pieces: PosedShapes
    shapes: list[int]  # for each piece: index of the object's shape that it belongs to
    model: Model
    excess: float
    convex: bool  # whether the object itself, not its model, is convex
    corners: tuple[NDArray[np.int32] | None, ...] = ()  # of each piece, if known: the `hull_vertices` of a ConvexHull


def parse_model(model: Model | str | int) -> Model:
    """Return the model with a name such as "obb" or a number. Raises InputError for an unknown one."""
    if isinstance(model, Model):
        return model
    if isinstance(model, str):
        chosen = Model.__members__.get(model.upper())
    else:
        chosen = Model(model) if model in list(Model) else None
    if chosen is None:
        raise InputError(f"model: expected one of {', '.join(MODEL_NAMES)}, got {model!r}")
    return chosen


def shape_class(shapes: Sequence[tuple[Shape, Pose]]) -> str | None:
    """Class of an object: primitive, hull, mesh or compound, each with a setting; None if there is no coarser model."""
    if any(is_planar(shape) or isinstance(shape, HalfSpace | Points | TiledSolid) for shape, _ in shapes):
        return None
    if len(shapes) > 1:
        return "compound"
    shape, _ = shapes[0]
    if isinstance(shape, Sphere):
        return None
    return "mesh" if isinstance(shape, Mesh) else "hull" if isinstance(shape, ConvexHull) else "primitive"


def containing_model(shapes: Sequence[tuple[Shape, Pose]], model: Model | str | int) -> Modelled:
    """Compute the model of an object of these shapes. AUTO means EXACT.

    Raises InputError for an unknown name, UnsupportedError if the model does not exist for the object.
    """
    chosen = parse_model(model)
    if chosen not in (Model.AUTO, Model.EXACT, Model.CONVEX_DECOMPOSITION) and _is_large_concave(shapes):
        return _around_large(shapes, chosen)
    pieces, index = [], []
    for k, (shape, pose) in enumerate(shapes):
        # the poses of the pieces cache their rotations, so those of a mesh at the origin are used again
        placed = pose.position.any() or pose.quaternion[3] != 1.0
        for piece, offset in convex_pieces(shape):
            pieces.append((piece, pose @ offset if placed else offset))
            index.append(k)
    convex = len(pieces) == 1
    if chosen in (Model.AUTO, Model.EXACT):
        return Modelled(pieces, index, Model.EXACT, 0.0, convex)
    for shape, _ in shapes:
        if is_planar(shape) or isinstance(shape, HalfSpace | Points):
            raise UnsupportedError(
                f"{type(shape).__name__}: model {chosen.name.lower()} is not offered; supported are auto, exact"
            )
    if chosen is Model.CONVEX_DECOMPOSITION:
        return _decomposed(shapes, convex)
    piece, pose = _enclose(pieces, chosen)
    return Modelled([(piece, pose)], [0], chosen, excess_of(shapes, pieces, piece, pose), convex)


def _is_large_concave(shapes: Sequence[tuple[Shape, Pose]]) -> bool:
    """Whether an object is one concave mesh of so many faces that they are not made pieces of."""
    shape, _ = shapes[0]
    return len(shapes) == 1 and isinstance(shape, Mesh) and len(shape.faces) > MANY_FACES and is_concave_mesh(shape)


def _around_large(shapes: Sequence[tuple[Shape, Pose]], model: Model, directions: Array | None = None) -> Modelled:
    """Model of one large concave mesh: what encloses its convex hull encloses it. directions: of the user's k-DOP."""
    mesh, at = shapes[0]
    assert isinstance(mesh, Mesh)
    vertices = mesh.vertices[np.unique(mesh.faces)] @ at.rotation.T + at.position
    if model is Model.CONVEX_HULL and directions is None:
        hull = QhullResult(vertices)
        solid = ConvexHull(vertices[hull.vertices])
        known = (np.arange(len(hull.vertices), dtype=np.int32),)
        excess = excess_of_large(mesh, at, vertices, solid, Pose(), hull)
        return Modelled([(solid, Pose())], [0], model, excess, False, known)
    whole: PosedShapes = [(ConvexHull(vertices), Pose())]
    around = _enclose(whole, model) if directions is None else _kdop(whole, directions, "of these directions")
    return Modelled([around], [0], model, excess_of_large(mesh, at, vertices, *around, None), False)


def monitored_model(shapes: Sequence[tuple[Shape, Pose]], model: Model | str | int) -> Modelled:
    """Compute the model that a monitor uses, as `containing_model`; but an exact concave mesh stays one piece.

    A mesh with an uncertain inside (`Surface.certain`) has no exact model. Its convex hull replaces it.
    """
    chosen = parse_model(model)
    if chosen not in (Model.AUTO, Model.EXACT):
        return containing_model(shapes, chosen)
    pairs, index = _separated(shapes)
    uncertain = [isinstance(shape, Mesh) and not shape.surface.certain for shape, _ in pairs]
    if not any(uncertain):
        return exact_model(shapes)
    parts = [
        containing_model([pair], Model.CONVEX_HULL) if open_ else exact_model([pair])
        for pair, open_ in zip(pairs, uncertain, strict=True)
    ]
    return Modelled(
        pieces=[piece for part in parts for piece in part.pieces],
        shapes=[k for k, part in zip(index, parts, strict=True) for _ in part.pieces],
        model=Model.CONVEX_HULL,
        excess=max(part.excess for part in parts),
        convex=False,
        corners=tuple(each for part in parts for each in part.corners or (None,) * len(part.pieces)),
    )


def _separated(shapes: Sequence[tuple[Shape, Pose]]) -> tuple[PosedShapes, list[int]]:
    """The shapes, with the closed parts and the sheets of each mesh apart; and the index of each in `shapes`."""
    pairs, index = [], []
    for k, (shape, pose) in enumerate(shapes):
        for part in _solids_of(shape):
            pairs.append((part, pose))
            index.append(k)
    return pairs, index


def _solids_of(shape: Shape) -> Sequence[Shape]:
    if isinstance(shape, TiledSolid):
        return shape.solids
    return separated(shape) if isinstance(shape, Mesh) else (shape,)


def exact_model(shapes: Sequence[tuple[Shape, Pose]]) -> Modelled:
    """Convex pieces, concave meshes and clouds that are exactly the object."""
    pieces: PosedShapes = []
    index = []
    pairs, of_shape = _separated(shapes)
    for k, (shape, pose) in zip(of_shape, pairs, strict=True):
        if is_concave_mesh(shape) or isinstance(shape, Points):
            pieces.append((shape, pose))
            index.append(k)
            continue
        placed = pose.position.any() or pose.quaternion[3] != 1.0
        for part, offset in convex_pieces(shape):
            pieces.append((part, pose @ offset if placed else offset))
            index.append(k)
    convex = len(pieces) == 1 and not isinstance(pieces[0][0], Mesh | Points)
    return Modelled(pieces, index, Model.EXACT, 0.0, convex)


def _decomposed(shapes: Sequence[tuple[Shape, Pose]], convex: bool) -> Modelled:
    """Replace concave meshes by convex parts; keep the other shapes."""
    pieces, index, excess = [], [], 0.0
    for k, (shape, pose) in enumerate(shapes):
        parts = convex_pieces(shape)
        if isinstance(shape, Mesh) and len(parts) > 1:
            found = convex_decomposition(shape)
            excess = max(excess, found.surface_error)
            # a part about its own centre has a small bounding sphere and loses no digits
            centres = [part.points.mean(axis=0) for part in found.parts]
            parts = tuple((ConvexHull(p.points - c), Pose(c)) for p, c in zip(found.parts, centres, strict=True))
        pieces += [(part, pose @ offset) for part, offset in parts]
        index += [k] * len(parts)
    return Modelled(pieces, index, Model.CONVEX_DECOMPOSITION, excess, convex)


def _enclose(pieces: PosedShapes, model: Model) -> tuple[Shape, Pose]:
    """Return the model around the pieces, with its pose in the object's frame."""
    shape, pose = pieces[0]
    single = len(pieces) == 1
    match model:
        case Model.SPHERE:
            farthest = kind_of(shape).farthest
            if single and farthest is not None:
                d = farthest(shape)
                return Sphere(float(reach([(shape, Pose())], d / np.linalg.norm(d))) * (1 + ROUNDED_UP)), pose
            ball = minimal_sphere(enclosing_points(pieces))
            return Sphere(float(ball.radius) * (1 + ROUNDED_UP)), Pose(ball.center)
        case Model.AABB:
            low, high = -reach(pieces, -np.eye(3)), reach(pieces, np.eye(3))
            return _box(high - low), Pose((low + high) / 2)
        case Model.OBB:
            if single and not isinstance(shape, ConvexHull | Triangle):
                low, high = -reach([(shape, Pose())], -np.eye(3)), reach([(shape, Pose())], np.eye(3))
                return _box(high - low), pose @ Pose((low + high) / 2)
            from scipy.spatial.transform import Rotation

            box = obb_minimum_volume(enclosing_points(pieces))
            axes = np.array(box.rotation)
            axes[:, 2] *= np.sign(np.linalg.det(axes))
            turned = Rotation.from_matrix(axes).as_quat()
            return _box(2 * box.half_extents), Pose(box.center, turned)
        case Model.CONVEX_HULL:
            if any(kind_of(s).round for s, _ in pieces):
                if single:
                    return shape, pose
                raise UnsupportedError("model convex_hull: the hull of several shapes with round ones is not offered")
            return ConvexHull(enclosing_points(pieces)), Pose()
    return _kdop(pieces, np.array(KDOP_DIRECTIONS[KDOPS[model]], float), model.name.lower())


def _box(size: Array) -> Box:
    """Box of these extents (m), rounded up."""
    return Box(size + ROUNDED_UP * float(size.max()))


def containing_kdop(shapes: Sequence[tuple[Shape, Pose]], directions: ArrayLike) -> Modelled:
    """Compute the k-DOP of an object of these shapes with the user's directions (k/2, 3) of any length but zero.

    It is reported as CONVEX_HULL, as the messages have no name for it. (Slide "Bounding Slabs": user-specified
    collection of bounding plane-pairs) Raises InputError for directions that leave the k-DOP without an end,
    UnsupportedError for a plane shape and a HalfSpace.
    """
    normals = coordinates(directions, "k-DOP directions", 3).reshape(-1, 3)
    if len(normals) > MOST_DIRECTIONS:
        raise InputError(f"k-DOP directions: expected at most {MOST_DIRECTIONS}, got {len(normals)}")
    if not np.abs(normals).max(axis=1).all():
        raise InputError("k-DOP directions: expected vectors with a direction, got a zero vector")
    normals = normals / np.abs(normals).max(axis=1, keepdims=True)
    if np.linalg.matrix_rank(normals, tol=1e-6) < 3:
        raise InputError("k-DOP directions: expected three or more that are not in one plane, got a slab without end")
    for shape, _ in shapes:
        if is_planar(shape) or isinstance(shape, HalfSpace | Points):
            raise UnsupportedError(f"{type(shape).__name__}: a k-DOP is not offered; supported are auto, exact")
    if _is_large_concave(shapes):
        return _around_large(shapes, Model.CONVEX_HULL, normals)
    pieces = [(piece, pose @ offset) for shape, pose in shapes for piece, offset in convex_pieces(shape)]
    solid, pose = _kdop(pieces, normals, "of these directions")
    excess = excess_of(shapes, pieces, solid, pose)
    return Modelled([(solid, pose)], [0], Model.CONVEX_HULL, excess, len(pieces) == 1)


def _kdop(pieces: PosedShapes, directions: Array, name: str) -> tuple[Shape, Pose]:
    """k-DOP with directions (k/2, 3) around the pieces, as a polytope."""
    from scipy.spatial import HalfspaceIntersection

    normals = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    normals = np.concatenate([normals, -normals])
    far = reach(pieces, normals)
    k = len(directions)
    if (np.abs(directions[:3]) == np.eye(3)).all():
        centre = (far[:3] - far[k : k + 3]) / 2  # middle of the slabs along x, y and z
    else:
        centre = enclosing_points(pieces).mean(axis=0)
    distance = far - normals @ centre
    size = float(distance.max())
    if not size > 0.0:
        raise ShapeError(f"model {name}: expected an object with an extent, got points in one place")
    # Qhull needs some space around the centre, which a flat object does not leave, and its result is rounded
    distance = np.maximum(distance, 1e-9 * size) + 1e-9 * size
    points = HalfspaceIntersection(np.column_stack([normals, -distance / size]), np.zeros(3)).intersections * size
    return ConvexHull(points), Pose(centre)
