"""Concave solids that are in each other while faces of both lie in one plane: surfaces touch, and no depth shows."""

from __future__ import annotations

import numpy as np
import pytest

import collision_monitor as cm
from collision_monitor import Motion, Pose

HEIGHT = 0.4


def plate() -> cm.Mesh:
    """A U of constant thickness: arms at x from -0.5 to -0.2 and from 0.2 to 0.5, joined at y from -0.5 to -0.2."""
    outline = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (0.2, 0.5), (0.2, -0.2), (-0.2, -0.2), (-0.2, 0.5), (-0.5, 0.5)]
    n = len(outline)
    vertices = np.array([(*p, z) for z in (-HEIGHT / 2, HEIGHT / 2) for p in outline])
    flat = [(0, 1, 4), (0, 4, 5), (1, 2, 3), (1, 3, 4), (0, 5, 6), (0, 6, 7)]
    faces = [(a, c, b) for a, b, c in flat] + [(a + n, b + n, c + n) for a, b, c in flat]
    for k in range(n):
        after = (k + 1) % n
        faces += [(k, after, after + n), (k, after + n, k + n)]
    return cm.Mesh(vertices, np.array(faces))


U = plate()
SMALL = cm.Mesh(U.vertices * (0.1, 0.1, 1.0), U.faces)
PEGS = [cm.Cylinder(0.05, HEIGHT), cm.Box((0.1, 0.1, HEIGHT)), SMALL]
STILL = Motion(Pose())
MOTIONS = [((0.0, 0, 0), (0.0, 0, 0)), ((0.01, 0.013, 0), (0.0, 0, 0)), ((0.01, 0.013, 0), (0.0, 0, 0.3))]


def test_the_plate_is_closed_and_concave() -> None:
    assert U.surface.certain and U.surface.volume == pytest.approx(HEIGHT * (1.0 - 0.4 * 0.7))


@pytest.mark.parametrize("other", PEGS, ids=lambda shape: type(shape).__name__)
@pytest.mark.parametrize("motion", MOTIONS)
def test_a_peg_in_a_plate_of_the_same_thickness_is_not_clear(other, motion) -> None:
    moving = Motion(Pose((-0.35, 0.1, 0.0)), *motion)
    for pair in ((U, STILL, other, moving), (other, moving, U, STILL)):
        impact = cm.time_of_impact(*pair, horizon=2.0)
        assert impact.status != "clear" and impact.lower == 0.0


@pytest.mark.parametrize("speed", [0.0, -0.1, 0.1])
def test_two_plates_in_each_other_are_not_clear(speed: float) -> None:
    moving = Motion(Pose((0.9, 0.0, 0.0)), (speed, 0, 0))
    for pair in ((U, STILL, U, moving), (U, moving, U, STILL)):
        impact = cm.time_of_impact(*pair, horizon=2.0)
        assert impact.status != "clear" and impact.lower == 0.0


def test_plates_that_only_touch_and_part_are_clear() -> None:
    moving = Motion(Pose((1.0, 0.0, 0.0)), (0.1, 0, 0))
    assert cm.time_of_impact(U, STILL, U, moving, horizon=2.0).status == "clear"
    assert cm.time_of_impact(U, STILL, cm.Box((1.0, 1.0, HEIGHT)), moving, horizon=2.0).status == "clear"
