"""`overlap`: whether two shapes have a point in common, by a selectable test."""

from __future__ import annotations

from typing import Any, Final

from collision_monitor.errors import InputError, UnsupportedError
from collision_monitor.geometry.bounding_volumes import Hull, convex_hull
from collision_monitor.geometry.coordinates import Array
from collision_monitor.geometry.lecture.cascade import polyhedra_intersect
from collision_monitor.geometry.lecture.polygon_overlap import Evidence, polygons_intersect, sat_2d
from collision_monitor.geometry.lecture.polyhedron_sat import sat_3d
from collision_monitor.geometry.triangulation import convex_parts
from collision_monitor.meshes.trees.shape_trees import UNCERTAIN
from collision_monitor.query.body import kept_slots
from collision_monitor.query.contact.contact import contact, plant_for_meshes
from collision_monitor.query.contact.contact_kernel import have_common_point
from collision_monitor.shapes.compound import Compound, shape_pairs
from collision_monitor.shapes.planar import flat_pose
from collision_monitor.shapes.pose import Pose, as_pose
from collision_monitor.shapes.registry import Box, ConvexHull, Mesh, Polygon, Shape

TESTS: Final = ("contact", "cascade", "sat", "edges")


def overlap(shape_a: Compound, pose_a: Any, shape_b: Compound, pose_b: Any, test: str = "contact") -> bool:
    """Whether two shapes, or compounds given as lists of (shape, pose), overlap or touch.

    test: "contact" for any shapes, by the sign of their distance; "cascade" for polyhedra, by the lecture's ordered
    tests (bounding volumes, vertices, edges against faces), exact for the placed corners; "sat" for convex polyhedra
    and for polygons, by the separating axis test, with concave polygons split; "edges" for polygons, by contained
    vertices and crossing edges, exact for the placed corners. Raises as `contact` does, InputError for an unknown
    test, and UnsupportedError for a shape that the test does not take.

    >>> import collision_monitor as cm
    >>> cm.overlap(cm.Sphere(1), cm.Pose(), cm.Sphere(1), cm.Pose((1.5, 0, 0)))
    True
    """
    pose_a, pose_b = as_pose(pose_a, "pose A"), as_pose(pose_b, "pose B")
    if test == "contact":
        a, b = kept_slots(shape_a), kept_slots(shape_b)
        if a is not None and b is not None and a.inside != UNCERTAIN and b.inside != UNCERTAIN:
            plant_for_meshes(a, shape_a, b, shape_b)
            return have_common_point(a.first, pose_a, b.first, pose_b)
        return contact(shape_a, pose_a, shape_b, pose_b).overlaps
    if not isinstance(test, str) or test not in TESTS:
        raise InputError(f"test: expected one of {', '.join(TESTS)}, got {test!r}")
    if test == "edges" or (test == "sat" and any(_is_polygon(shape) for shape in (shape_a, shape_b))):
        plane = _polygons(shape_a, pose_a, test, "A"), _polygons(shape_b, pose_b, test, "B")
        if test == "edges":
            return any(polygons_intersect(a, b) is not Evidence.SEPARATE for a in plane[0] for b in plane[1])
        first, second = ([polygon[part] for polygon in side for part in convex_parts(polygon)] for side in plane)
        return any(sat_2d(a, b).overlaps for a in first for b in second)
    solids = _solids(shape_a, pose_a, test, "A"), _solids(shape_b, pose_b, test, "B")
    if test == "sat":
        return any(sat_3d(a, b).overlaps for a in solids[0] for b in solids[1])
    return any(polyhedra_intersect(*a, *b).collides for a in solids[0] for b in solids[1])


def _is_polygon(shape: Compound) -> bool:
    return any(isinstance(each, Polygon) for each, _ in shape_pairs(shape, "shape"))


def _polygons(shape: Compound, pose: Pose, test: str, name: str) -> list[Array]:
    """Corners (n, 2) of the polygons in the world frame."""
    found = []
    for each, offset in shape_pairs(shape, f"shape {name}"):
        if not isinstance(each, Polygon):
            kinds = "Polygon" if test == "edges" else "Polygon with Polygon, and Box, ConvexHull with each other"
            raise UnsupportedError(f"test {test}: {type(each).__name__} is not offered; supported are {kinds}")
        if each.radius > 0.0:
            raise UnsupportedError(f"test {test}: Polygon with a radius is not offered; use the test 'contact'")
        at = flat_pose(pose @ offset)
        found.append(each.points @ at.rotation[:2, :2].T + at.position[:2])
    return found


def _solids(shape: Compound, pose: Pose, test: str, name: str) -> list[Hull]:
    """Corners and faces of the shapes in the world frame."""
    found = []
    for each, offset in shape_pairs(shape, f"shape {name}"):
        solid = _polyhedron(each, test)
        placed = (solid.vertices @ offset.rotation.T + offset.position) @ pose.rotation.T + pose.position
        found.append(Hull(placed, solid.faces))
    return found


def _polyhedron(shape: Shape, test: str) -> Hull:
    match shape:
        case Box():
            return convex_hull(shape.corners)
        case ConvexHull():
            return convex_hull(shape.points)
        case Mesh() if test == "cascade" and shape.surface.closed:
            return Hull(shape.surface.vertices, shape.surface.faces)
    kinds = "Box, ConvexHull, closed Mesh" if test == "cascade" else "Box, ConvexHull"
    raise UnsupportedError(f"test {test}: {type(shape).__name__} is no such polyhedron; supported are {kinds}")
