"""Our MarkerArray bytes, read back by rclpy."""

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from visualization_msgs.msg import Marker as RosMarker
from visualization_msgs.msg import MarkerArray

from collision_monitor.ros.monitor.marker_bytes import Marker, MarkerKind, encode
from collision_monitor.shapes.registry import (
    Box,
    Capsule,
    Circle,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Mesh,
    Polygon,
    Sphere,
    kind_of,
)


def test_rclpy_reads_what_was_written():
    points = np.random.default_rng(1).normal(size=(6, 3))
    markers = [
        Marker("touching", MarkerKind.TRIANGLE_LIST, (0.25, 0.5, 0.75, 1.0), points),
        Marker(
            "überall", MarkerKind.TEXT, (1, 0, 0, 1), scale=(0, 0, 0.4), number=7, position=(1, 2, 3), text="0.42 s"
        ),
        Marker("gone", MarkerKind.LINE_LIST, (1, 1, 1, 1)),
    ]
    read = deserialize_message(encode(12_000_000_034, "map", markers), MarkerArray).markers
    first, text, gone = read
    assert (first.header.stamp.sec, first.header.stamp.nanosec, first.header.frame_id) == (12, 34, "map")
    assert (first.ns, first.type, first.action) == ("touching", RosMarker.TRIANGLE_LIST, RosMarker.ADD)
    assert np.array_equal([[p.x, p.y, p.z] for p in first.points], points)
    assert (first.color.r, first.color.g, first.color.b, first.color.a) == (0.25, 0.5, 0.75, 1.0)
    assert (first.pose.orientation.w, first.scale.x) == (1.0, 1.0)
    assert (text.ns, text.id, text.type, text.text) == ("überall", 7, RosMarker.TEXT_VIEW_FACING, "0.42 s")
    assert (text.pose.position.x, text.pose.position.z, text.scale.z) == (1.0, 3.0, 0.4)
    assert gone.action == RosMarker.DELETE


def triangles_of(shape):
    return kind_of(shape).triangles(shape)


TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])


@pytest.mark.parametrize(
    ("shape", "low", "high"),
    [
        (Sphere(2), (-2, -2, -2), (2, 2, 2)),
        (Box((1, 2, 3)), (-0.5, -1, -1.5), (0.5, 1, 1.5)),
        (Capsule(1, 2), (-1, -1, -2), (1, 1, 2)),
        (Cylinder(1, 2), (-1, -1, -1), (1, 1, 1)),
        (Cone(1, 2), (-1, -1, -1), (1, 1, 1)),
        (Ellipsoid((1, 2, 3)), (-1, -2, -3), (1, 2, 3)),
        (Circle(3), (-3, -3, 0), (3, 3, 0)),
        (ConvexHull(TETRAHEDRON), (0, 0, 0), (1, 1, 1)),
        (Mesh(TETRAHEDRON, [[0, 1, 2], [0, 1, 3]]), (0, 0, 0), (1, 1, 1)),
        (Polygon([[0, 0], [2, 0], [0, 2]]), (0, 0, 0), (2, 2, 0.1)),
        (Polygon([[0, 0], [2, 0]], 1), (-1, -1, 0), (3, 1, 0.1)),
        (HalfSpace((0, 0, 1), 0.5), (-10, -10, 0.5), (10, 10, 0.5)),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_surface_fills_the_extent_of_its_shape(shape, low, high):
    corners = triangles_of(shape).reshape(-1, 3)
    assert corners.min(axis=0) == pytest.approx(low, abs=1e-12)
    assert corners.max(axis=0) == pytest.approx(high, abs=1e-12)


@pytest.mark.parametrize(("shape", "volume"), [(Box((1, 2, 3)), 6.0), (Cylinder(1, 2), 2 * np.pi), (Sphere(1), 4.19)])
def test_the_faces_of_a_solid_look_outwards(shape, volume):
    a, b, c = np.moveaxis(triangles_of(shape), 1, 0)
    enclosed = np.einsum("ni,ni->", a, np.cross(b, c)) / 6
    assert enclosed == pytest.approx(volume, rel=0.1)
