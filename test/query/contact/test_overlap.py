"""The methods of `overlap` give the same answer and refuse shapes that they do not support."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor import Box, ConvexHull, Mesh, Pose, Sphere, overlap

ROCK = ConvexHull(np.random.default_rng(3).normal(size=(14, 3)) * 0.5)
_RING = trimesh.creation.torus(1.0, 0.3, major_sections=10, minor_sections=5)
RING = Mesh(_RING.vertices, _RING.faces)
BARS = [(Box((2, 0.2, 0.2)), Pose()), (Box((0.2, 2, 0.2)), Pose((0.5, 0, 0)))]


@pytest.mark.parametrize(("a", "b"), [(Box((1, 2, 0.5)), ROCK), (ROCK, ROCK), (BARS, ROCK), (BARS, BARS), (RING, ROCK)])
def test_they_agree(a: cm.Shape, b: cm.Shape) -> None:
    rng = np.random.default_rng(6)
    seen = set()
    for _ in range(25):
        q = Rotation.random(2, rng=rng).as_quat()
        X, Y = Pose(rng.normal(size=3), q[0]), Pose(rng.normal(size=3), q[1])
        expected = cm.contact(a, X, b, Y).overlaps
        seen.add(expected)
        assert overlap(a, X, b, Y) == overlap(a, X, b, Y, test="cascade") == expected
        if a is not RING:
            assert overlap(a, X, b, Y, test="sat") == expected
    assert seen == {True, False}


def test_one_in_the_other_and_a_ball_in_the_hole() -> None:
    small = Box((0.1, 0.1, 0.1))
    for test in ("contact", "cascade"):
        assert overlap(RING, Pose(), small, Pose((1.0, 0, 0)), test=test)
        assert not overlap(RING, Pose(), small, Pose(), test=test)


@pytest.mark.parametrize(
    ("shape", "test", "error", "words"),
    [
        (Sphere(1), "cascade", cm.UnsupportedError, "Sphere is no such polyhedron; supported are Box, ConvexHull, clo"),
        (RING, "sat", cm.UnsupportedError, "Mesh is no such polyhedron; supported are Box, ConvexHull"),
        (Mesh(RING.vertices, RING.faces[1:]), "cascade", cm.UnsupportedError, "closed Mesh"),
        (ROCK, "guess", cm.InputError, "expected one of contact, cascade, sat, edges, got 'guess'"),
        (7, "sat", cm.ShapeError, "expected a shape or a list"),
    ],
)
def test_what_is_refused(shape: cm.Shape, test: str, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        overlap(shape, Pose(), ROCK, Pose(), test=test)
    with pytest.raises(cm.PoseError, match="pose B: expected a Pose"):
        overlap(ROCK, Pose(), ROCK, None, test="sat")  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", range(40))
def test_polygons_overlap_alike_by_distance_sat_and_edges(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shapes = []
    for _ in range(2):
        angle, far = 2 * np.pi * (np.arange(9) + rng.uniform(0, 0.9, 9)) / 9, rng.uniform(0.3, 1.0, (9, 1))
        shapes.append(cm.Polygon(far * np.stack([np.cos(angle), np.sin(angle)], axis=1)))
    turn = rng.uniform(-3, 3, 2)
    poses = [cm.Pose((x, 0, 0), (0, 0, np.sin(t / 2), np.cos(t / 2))) for x, t in zip((0.0, 1.1), turn, strict=True)]
    answers = {test: cm.overlap(shapes[0], poses[0], shapes[1], poses[1], test) for test in ("contact", "sat", "edges")}
    assert len(set(answers.values())) == 1, answers


def test_edges_are_for_polygons() -> None:
    square = cm.Polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    assert cm.overlap(square, cm.Pose(), square, cm.Pose((1, 1, 0)), "edges")
    with pytest.raises(cm.UnsupportedError, match="test edges: Box"):
        cm.overlap(square, cm.Pose(), cm.Box((1, 1, 1)), cm.Pose(), "edges")
    rounded = cm.Polygon(square.points, radius=0.3)
    for test in ("edges", "sat"):
        with pytest.raises(cm.UnsupportedError, match=f"test {test}: Polygon with a radius"):
            cm.overlap(square, cm.Pose(), rounded, cm.Pose((1.2, 0, 0)), test)
    with pytest.raises(cm.UnsupportedError, match="test sat: Circle"):
        cm.overlap(square, cm.Pose(), cm.Circle(1), cm.Pose(), "sat")
