"""`kdop`: contains the object, exceeds it by no more than stated, and serves queries and the monitor."""

from __future__ import annotations

import numpy as np
import pytest

import collision_monitor as cm

SLABS = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 2, 0), (0, -1, 3)]
RNG = np.random.default_rng(5)
OBJECTS = [
    cm.Cylinder(0.5, 2.0),
    cm.ConvexHull(RNG.normal(size=(12, 3))),
    [(cm.Sphere(0.4), cm.Pose((1, 0, 0))), (cm.Box((1, 0.3, 0.5)), cm.Pose((0, 1, 0)))],
]


@pytest.mark.parametrize("shape", OBJECTS)
def test_it_is_the_intersection_of_the_slabs_around_the_object(shape: object) -> None:
    """In each direction it reaches as far as points of the object do; its distances are less by at most the excess."""
    slabs = cm.kdop(shape, SLABS)
    (solid, pose), rng = slabs.pieces[0], np.random.default_rng(6)
    points = rng.normal(size=(20000, 3)) * 1.5
    inside = points[cm.contains(shape, cm.Pose(), points)]
    assert cm.contains(slabs.pieces, cm.Pose(), inside).all()
    corners = solid.points @ pose.rotation.T + pose.position
    for d in np.array(SLABS, float) / np.linalg.norm(SLABS, axis=1, keepdims=True):
        for n in (d, -d):
            beyond = (corners @ n).max() + 0.01
            far = cm.contact(shape, cm.Pose(), cm.HalfSpace(-n, -beyond), cm.Pose())
            assert far.signed_distance == pytest.approx(0.01, abs=1e-6)
    ball = cm.Sphere(0.1)
    for at in rng.normal(size=(30, 3)) * 4:
        exact, model = (cm.distance(each, cm.Pose(), ball, cm.Pose(at)) for each in (shape, slabs.pieces))
        if exact > 0.0:
            assert model - 1e-6 <= exact <= model + slabs.excess + 1e-6


def test_the_monitor_takes_it() -> None:
    monitor = cm.Monitor()
    monitor.add(1, cm.kdop(OBJECTS[0], SLABS).pieces)
    monitor.add(2, cm.Sphere(0.5))
    poses = [(0, 0, 0, 0, 0, 0, 1), (0.9, 0, 0, 0, 0, 0, 1)]
    assert len(monitor.step(0, [1, 2], poses, np.zeros((2, 6))).contacts) == 1


@pytest.mark.parametrize(
    ("shape", "directions", "error", "text"),
    [
        (cm.Sphere(1), [(1, 0, 0), (0, 1, 0), (1, 1, 0)], cm.InputError, "slab without end"),
        (cm.Sphere(1), [(1, 0, 0), (0, 0, 0)], cm.InputError, "zero vector"),
        (cm.Sphere(1), "xyz", cm.InputError, "numbers"),
        (cm.HalfSpace((0, 0, 1)), SLABS, cm.UnsupportedError, "HalfSpace"),
        ("ball", SLABS, cm.ShapeError, "shape"),
    ],
)
def test_bad_input_is_refused(shape: object, directions: object, error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        cm.kdop(shape, directions)
