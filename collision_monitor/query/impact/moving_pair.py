"""Two moving compounds in the arrays that the monitor's kernels read, and their first impact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import PoseError, TooCostlyError, UnsupportedError
from collision_monitor.geometry.bounded_cache import bounded_cache
from collision_monitor.impact.body_impact import ImpactQuery, make_scratch
from collision_monitor.impact.impact_record import IMPACT
from collision_monitor.impact.pair_impacts import bodies_overlap_time, predict_pairs
from collision_monitor.meshes.trees.shape_trees import shape_tree
from collision_monitor.motion.bodies import BodyTable, Multibody, make_bodies, make_parts
from collision_monitor.motion.body_layout import lay_out_body
from collision_monitor.objects.excess import PosedShapes
from collision_monitor.objects.models import containing_model, exact_model
from collision_monitor.query.arguments import Compound
from collision_monitor.query.contact.surface_pair import points_near
from collision_monitor.shapes.compound import shape_pairs
from collision_monitor.shapes.convex_pieces import is_concave_mesh
from collision_monitor.shapes.forest import Forest
from collision_monitor.shapes.planar import flat_pose, is_planar
from collision_monitor.shapes.pose import Motion, Pose
from collision_monitor.shapes.reach import reach
from collision_monitor.shapes.registry import HalfSpace, Mesh, Points, Shape, Sphere, Triangle
from collision_monitor.shapes.shape_table import ShapeTableBuilder

MANY_FACES: Final = 100
"""Faces of a mesh from which on only those near the other object are followed one by one, and the rest as one mesh.
More: open meshes that touch take longer, 0.3 to 0.8 s with 2,000, but 0.03 to 0.4 s with 100."""

MOST_FACES: Final = 10_000
"""Most faces that are followed one by one, 1 s."""

MOST_NEAR: Final = 500
"""Most points of a cloud that touch the other object and are followed one by one, 1 ms each."""

REMEMBERED: Final = 256 << 20
"""Bytes of the trees of pairs that are remembered. Less: each query of two meshes copies them, 1 ms for
5,000 triangles."""

ITERATIONS: Final = 1000
"""Default limit of distance queries for one pair of pieces; hardly any pair needs more than 20."""


class MotionQuery(NamedTuple):
    """Parameters of the search for the first time at which two moving shapes are within the separation."""

    horizon: float  # s
    tolerance: float  # m
    separation: float  # m
    iterations: int  # limit of distance queries for a pair of convex pieces


class MovingShape(NamedTuple):
    """One of two moving objects: its shapes, and the convex pieces or meshes that represent them, in its frame."""

    shapes: Sequence[tuple[Shape, Pose]]
    pieces: PosedShapes
    shape_of: list[int]
    motion: Motion


def make_moving_shape(shape: Compound, motion: Motion, name: str) -> MovingShape:
    """Check one of the two. Motion out of the plane of plane shapes is ignored.

    Raises ShapeError, PoseError; UnsupportedError for a rotating HalfSpace.
    """
    shapes = shape_pairs(shape, f"shape {name}")
    if not isinstance(motion, Motion):
        raise PoseError(f"motion {name}: expected a Motion, got {type(motion).__name__}; write Motion(pose)")
    if any(isinstance(s, HalfSpace) for s, _ in shapes) and motion.angular.any():
        raise UnsupportedError(f"shape {name}: a HalfSpace has no end and cannot turn")
    if is_planar(shapes[0][0]):
        x, y, _ = motion.linear
        level = (*motion.acceleration[:2], 0.0)
        motion = Motion(flat_pose(motion.pose), (x, y, 0.0), (0.0, 0.0, motion.angular[2]), level)
    modelled = exact_model(shapes)
    return MovingShape(shapes, modelled.pieces, modelled.shapes, motion)


def in_convex_pieces(moving: MovingShape, other: MovingShape, near: float) -> MovingShape:
    """The same object with the triangles of a concave mesh, and the points of a cloud, as own pieces.

    Of clouds and of large meshes only those at most `near` (m) from the other object now, which may touch it. Raises
    TooCostlyError for more than MOST_NEAR points or MOST_FACES triangles.
    """
    pieces: PosedShapes = []
    shape_of = []
    for k, (shape, pose) in enumerate(moving.shapes):
        if isinstance(shape, Points):
            own = [(part, pose @ at) for part, at in _near_points(shape, moving.motion.pose @ pose, other, near)]
        elif isinstance(shape, Mesh) and len(shape.faces) > MANY_FACES and is_concave_mesh(shape):
            own = [(part, pose @ at) for part, at in _near_faces(shape, moving.motion.pose @ pose, other, near)]
        else:
            own = containing_model([(shape, pose)], "exact").pieces
        pieces += own
        shape_of += [k] * len(own)
    return moving._replace(pieces=pieces, shape_of=shape_of)


def _near_points(cloud: Points, pose: Pose, other: MovingShape, near: float) -> PosedShapes:
    """Each point near the other object as a ball, and the cloud of the remaining ones."""
    is_near = np.zeros(len(cloud.points), np.bool_)
    for shape, at in other.pieces:
        is_near |= points_near(cloud.points, cloud.radius, pose, shape, other.motion.pose @ at, near)
    if np.count_nonzero(is_near) > MOST_NEAR:
        raise TooCostlyError(f"expected at most {MOST_NEAR} points that touch, got {np.count_nonzero(is_near)}")
    balls: PosedShapes = [
        (Sphere(cloud.radius) if cloud.radius else Triangle(np.zeros((3, 3))), Pose(point))
        for point in cloud.points[is_near]
    ]
    return balls if is_near.all() else [*balls, (Points(cloud.points[~is_near], cloud.radius), Pose())]


def _near_faces(mesh: Mesh, pose: Pose, other: MovingShape, near: float) -> PosedShapes:
    """Each triangle in the box around the other object, and in front of its half-spaces; and the mesh of the others."""
    at = other.motion.pose
    normals = [pose.rotation @ shape.normal for shape, pose in other.pieces if isinstance(shape, HalfSpace)]
    own = np.concatenate([np.eye(3), -np.eye(3), np.reshape(normals, (-1, 3))])
    directions = own @ at.rotation.T
    far = reach(other.pieces, own) + directions @ (at.position - pose.position) + near
    is_near = np.ones(len(mesh.faces), np.bool_)
    for d, end in zip(directions @ pose.rotation, far, strict=True):
        is_near &= (mesh.vertices @ d)[mesh.faces].min(axis=1) <= end
    count = np.count_nonzero(is_near)
    if count > MOST_FACES:
        raise TooCostlyError(f"expected at most {MOST_FACES} triangles that may touch, got {count}")
    corners = mesh.vertices[mesh.faces[is_near]]
    centres = corners.mean(axis=1)
    pieces: PosedShapes = [(Triangle(c - m), Pose(m)) for c, m in zip(corners, centres, strict=True)]
    return pieces if is_near.all() else [*pieces, (Mesh(mesh.vertices, mesh.faces[~is_near]), Pose())]


def _bytes(forest: Forest, pieces: tuple[Shape, ...]) -> int:
    return forest.blocks.nbytes


@bounded_cache(REMEMBERED, _bytes)
def _forest(pieces: tuple[Shape, ...]) -> Forest:
    """The trees of all pieces that have one."""
    trees = [tree for tree in map(shape_tree, pieces) if tree is not None]
    forest = Forest(sum(map(len, {id(tree): tree for tree in trees}.values())))
    for tree in trees:
        forest.add(tree)
    return forest


def lay_out_pair(a: MovingShape, b: MovingShape, horizon: float, apart: bool = False) -> Multibody:
    """Lay out both with reference motions from 0 to the horizon (s); `apart`: each piece is a body of its own.

    The pieces of A come first in the table, then those of B.
    """
    count = len(a.pieces) + len(b.pieces)
    pieces = tuple(piece for moving in (a, b) for piece, _ in moving.pieces)
    forest = _forest(pieces).with_own_users() if any(isinstance(piece, Mesh | Points) for piece in pieces) else None
    builder = ShapeTableBuilder(slots=count, forest=forest)
    slots = [
        [builder.append(piece, pose, tree=shape_tree(piece) if forest else None) for piece, pose in moving.pieces]
        for moving in (a, b)
    ]
    multibody = Multibody(builder.table, make_parts(count), make_bodies(count if apart else 2))
    k = 0
    for moving, own in zip((a, b), slots, strict=True):
        chains = [[n] for n in range(len(own))] if apart else [list(range(len(own)))]
        for chain in chains:
            lay_out_body(multibody, k, [own[n] for n in chain], [moving.shape_of[n] for n in chain])
            _set_reference_motion(multibody.bodies, k, moving.motion, horizon)
            k += 1
    return multibody


def _set_reference_motion(bodies: BodyTable, k: int, motion: Motion, horizon: float) -> None:
    bodies.id[k] = k
    reference = bodies.motion[k]
    reference["cover"] = horizon
    reference["x"], reference["y"], reference["z"] = motion.pose.position
    reference["vx"], reference["vy"], reference["vz"] = motion.linear
    reference["ax"], reference["ay"], reference["az"] = motion.acceleration
    reference["wx"], reference["wy"], reference["wz"] = motion.angular
    reference["rotation"] = motion.pose.rotation


def first_impacts(
    multibody: Multibody, pairs: NDArray[np.int32], begin: float, query: MotionQuery, separation: float | None = None
) -> NDArray[np.void]:
    """First impacts (IMPACT) of the pairs (P, 2) of bodies from `begin` (s) on; pairs without an impact are omitted.

    separation (m): replaces that of the query; it is negative to find overlaps of that depth.
    """
    events = np.zeros(len(pairs) + 1, IMPACT)
    wanted = query.separation if separation is None else separation
    search = ImpactQuery(wanted, query.tolerance, query.iterations)
    found, _ = predict_pairs(multibody, pairs, begin, search, events, make_scratch())
    return events[:found]


def deep_overlap_time(multibody: Multibody, query: MotionQuery, round_off: float) -> float:
    """Time (s) at which a point is certainly in two solids, both deeper than `round_off` (m), or infinity.

    Only for meshes; it finds overlaps where no triangles cross because they lie in one plane.
    """
    search = ImpactQuery(query.separation - 2.0 * round_off, query.tolerance, query.iterations)
    return float(bodies_overlap_time(multibody, query.horizon, search, make_scratch()))
