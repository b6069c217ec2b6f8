"""Concave solids with faces in one plane that come together, slide or are in each other: no triangles cross."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor import Motion, Pose

HEIGHT = 0.4


def plate(height: float = HEIGHT, inward: bool = False) -> cm.Mesh:
    """A U of constant thickness: arms at x from -0.5 to -0.2 and from 0.2 to 0.5, joined at y from -0.5 to -0.2."""
    outline = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (0.2, 0.5), (0.2, -0.2), (-0.2, -0.2), (-0.2, 0.5), (-0.5, 0.5)]
    n = len(outline)
    vertices = np.array([(*p, z) for z in (-height / 2, height / 2) for p in outline])
    flat = [(0, 1, 4), (0, 4, 5), (1, 2, 3), (1, 3, 4), (0, 5, 6), (0, 6, 7)]
    faces = [(a, c, b) for a, b, c in flat] + [(a + n, b + n, c + n) for a, b, c in flat]
    for k in range(n):
        after = (k + 1) % n
        faces += [(k, after, after + n), (k, after + n, k + n)]
    return cm.Mesh(vertices, np.array(faces)[:, :: -1 if inward else 1])


U = plate()
SMALL = cm.Mesh(U.vertices * (0.1, 0.1, 1.0), U.faces)
PEGS = [cm.Cylinder(0.05, HEIGHT), cm.Box((0.1, 0.1, HEIGHT)), SMALL]
STILL = Motion(Pose())
MOTIONS = [((0.0, 0, 0), (0.0, 0, 0)), ((0.01, 0.013, 0), (0.0, 0, 0)), ((0.01, 0.013, 0), (0.0, 0, 0.3))]


def test_the_meshes_are_closed() -> None:
    assert block(1.0).surface.volume == pytest.approx(HEIGHT) and block(1.5).surface.certain
    assert U.surface.certain and U.surface.volume == pytest.approx(HEIGHT * (1.0 - 0.4 * 0.7))


@pytest.mark.parametrize("other", PEGS, ids=lambda shape: type(shape).__name__)
@pytest.mark.parametrize("motion", MOTIONS)
def test_a_peg_in_a_plate_of_the_same_thickness_is_not_clear(other, motion) -> None:
    moving = Motion(Pose((-0.35, 0.1, 0.0)), *motion)
    for pair in ((U, STILL, other, moving), (other, moving, U, STILL)):
        impact = cm.time_of_impact(*pair, horizon=2.0)
        assert impact.status != "clear" and impact.lower == 0.0


@pytest.mark.parametrize("speed", [0.0, -0.1, 0.1])
def test_two_plates_in_each_other_are_a_hit_at_once(speed: float) -> None:
    moving = Motion(Pose((0.9, 0.0, 0.0)), (speed, 0, 0))
    for pair in ((U, STILL, U, moving), (U, moving, U, STILL)):
        impact = cm.time_of_impact(*pair, horizon=2.0)
        assert (impact.status, impact.lower, impact.upper) == ("hit", 0.0, 0.0)


def test_plates_that_only_touch_and_part_are_clear() -> None:
    moving = Motion(Pose((1.0, 0.0, 0.0)), (0.1, 0, 0))
    assert cm.time_of_impact(U, STILL, U, moving, horizon=2.0).status == "clear"
    assert cm.time_of_impact(U, STILL, cm.Box((1.0, 1.0, HEIGHT)), moving, horizon=2.0).status == "clear"


def test_plates_that_touch_and_press_on_are_a_hit() -> None:
    """Their front triangles start in one plane: without an inside they would go through each other."""
    for turn in [Rotation.identity(), *Rotation.random(4, rng=np.random.default_rng(1))]:
        place = Pose((0.0, 0.0, 0.0), turn.as_quat())
        still, moving = Motion(place), Motion(place @ Pose((1.0, 0.0, 0.0)), turn.apply((-0.1, 0, 0)))
        for pair in ((U, still, U, moving), (U, moving, U, still)):
            impact = cm.time_of_impact(*pair, horizon=2.0)
            assert impact.status == "hit" and impact.lower == 0.0 and impact.upper < 1e-3


FRONT = np.array([(-0.5, -0.5, -0.2), (-0.5, -0.5, 0.2), (-0.5, 0.5, 0.2), (-0.5, 0.5, -0.2)])
"""The outline of the plate's side at x = -0.5, anticlockwise as seen from there."""


def block(back: float) -> cm.Mesh:
    """A block with this front, whose back is so many times as wide; above 1, only fronts are in one plane."""
    sides = [face for k in range(4) for face in ((k, k + 4, (k + 1) % 4), ((k + 1) % 4, k + 4, (k + 1) % 4 + 4))]
    vertices = np.concatenate([FRONT, FRONT * (-1.0, back, back)])
    return cm.Mesh(vertices, np.array([(0, 1, 2), (0, 2, 3), (4, 6, 5), (4, 7, 6), *sides]))


THIN = plate(1e-3)
FRONTAL = {
    "plates": (U, U),
    "plate and box": (U, cm.Box((1.0, 1.0, HEIGHT))),
    "plate and closed mesh": (U, block(1.0)),
    "thin plates": (THIN, THIN),
    "thinner than the steps": (plate(1e-6), plate(1e-6)),
    "faces look inward": (plate(inward=True), U),
    "plug": (U, block(1.5)),
}
"""Shapes whose whole fronts, at x = 0.5 and x = -0.5 of the second one, meet with equal outlines."""


def scaled(shape: cm.Shape, scale: float) -> cm.Shape:
    if isinstance(shape, cm.Mesh):
        return cm.Mesh(shape.vertices * scale, shape.faces)
    assert isinstance(shape, cm.Box)
    return cm.Box(np.asarray(shape.size) * scale)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("name", FRONTAL)
def test_fronts_with_equal_outlines_are_a_hit(name: str, scale: float) -> None:
    a, b = (scaled(shape, scale) for shape in FRONTAL[name])
    still, moving = Motion(Pose((0, 0, 0))), Motion(Pose((1.5 * scale, 0, 0)), (-scale, 0, 0))
    for pair in ((a, still, b, moving), (b, moving, a, still)):
        impact = cm.time_of_impact(*pair, tolerance=1e-6 * scale)
        assert impact.status == "hit" and impact.lower <= 0.5 + 1e-9 <= impact.upper + 2e-9
        assert impact.upper - impact.lower < 1e-5


@pytest.mark.parametrize("name", FRONTAL)
def test_a_hit_does_not_depend_on_the_frame(name: str) -> None:
    """Both turn and move together; the pose of the whole, and that of each in its own frame, are random."""
    rng = np.random.default_rng(2)
    for turn in Rotation.random(8, rng=rng):
        a, b = FRONTAL[name]
        place, at, moved = Pose(rng.normal(size=3) * 3.0, turn.as_quat()), Pose((1.5, 0, 0)), b
        if isinstance(b, cm.Mesh):  # its coordinates are rounded in another frame
            own = Pose(rng.normal(size=3), Rotation.random(rng=rng).as_quat())
            back = own.inverse()
            moved, at = cm.Mesh(b.vertices @ back.rotation.T + back.position, b.faces), at @ own
        at = place @ at
        common = rng.normal(size=3)
        still, moving = Motion(place, common), Motion(at, common + turn.apply((-1.0, 0, 0)))
        for pair in ((a, still, moved, moving), (moved, moving, a, still)):
            impact = cm.time_of_impact(*pair)
            assert impact.status == "hit" and impact.lower <= 0.5 <= impact.upper + 1e-12
            assert impact.upper - impact.lower < 1e-5


def test_a_plate_that_swings_is_a_hit() -> None:
    """It turns about an axis 50 m away, at -y; both fronts are in one plane at 0.5 s."""
    rate, arm = 0.02, 50.0
    swung = cm.Mesh(U.vertices + np.array((1.0, arm, 0.0)), U.faces)
    turning = Motion(Pose.from_euler(0.0, 0.0, -0.5 * rate), angular=(0, 0, rate))
    impact = cm.time_of_impact(U, Motion(Pose((0.0, arm, 0.0))), swung, turning)
    assert impact.status == "hit" and impact.lower <= 0.5 + 1e-9 <= impact.upper + 2e-9
    assert impact.upper - impact.lower < 1e-4


@pytest.mark.parametrize("depth", [HEIGHT, 0.6])
def test_a_box_that_fits_a_slot_hits_its_end(depth: float) -> None:
    """Its sides touch those of the slot from 1.3 s on, and its front the end of the slot at 2 s."""
    box, moving = cm.Box((0.4, 0.4, depth)), Motion(Pose((0, 2, 0)), (0, -1, 0))
    for pair in ((U, STILL, box, moving), (box, moving, U, STILL)):
        impact = cm.time_of_impact(*pair, horizon=3.0)
        assert impact.lower == pytest.approx(1.3, abs=1e-5)
        assert impact.status == "unresolved" or (impact.status == "hit" and 2.0 <= impact.upper < 3.0)


BESIDE = {
    "side by side": ((1.0, 3.0, 0.0), (0.0, -2.0, 0.0)),
    "on each other": ((3.0, 0.1, HEIGHT), (-2.0, 0.0, 0.0)),
    "edge on edge": ((1.0, 3.0, HEIGHT), (0.0, -2.0, 0.0)),
    "at a distance": ((1.01, 3.0, 0.0), (0.0, -2.0, 0.0)),
    "at rest": ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
}
"""Motions of a plate past another one that touches it, or not, but never enters it."""


@pytest.mark.parametrize("name", BESIDE)
def test_plates_that_slide_past_each_other_are_no_hit(name: str) -> None:
    start, speed = BESIDE[name]
    rng = np.random.default_rng(3)
    for turn in [Rotation.identity(), *Rotation.random(6, rng=rng)]:
        place = Pose(rng.normal(size=3), turn.as_quat())
        still, moving = Motion(place), Motion(place @ Pose(start), turn.apply(speed))
        for other in (U, cm.Box((1.0, 1.0, HEIGHT))):
            for pair in ((U, still, other, moving), (other, moving, U, still)):
                impact = cm.time_of_impact(*pair, horizon=3.0)
                assert impact.status != "hit"
                assert name != "at a distance" or impact.status == "clear"


def test_a_bar_that_fits_a_slot_slides_through_it() -> None:
    moving = Motion(Pose((0, 0, 2.0)), (0, 0, -1.0))
    assert cm.time_of_impact(U, STILL, cm.Box((0.4, 0.4, 1.0)), moving, horizon=4.0).status != "hit"
