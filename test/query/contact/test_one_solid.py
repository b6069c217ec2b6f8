"""Tests that the single call of two convex solids gives the bits of the general search, which compounds still take."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.typing import NDArray

import collision_monitor as cm

RNG = np.random.default_rng(5)
SOLIDS = (
    cm.Sphere(0.6),
    cm.Box((1.0, 1.2, 0.8)),
    cm.Box((2.0, 0.0, 0.5)),
    cm.Capsule(0.3, 1.0),
    cm.Cylinder(0.4, 1.1),
    cm.Cone(0.5, 0.9),
    cm.ConvexHull(RNG.normal(size=(21, 3))),
    cm.ConvexHull(RNG.normal(size=(200, 3)) / 10 + (3.0, 0.0, 0.0)),
)
TURNS = ((0, 0, 0, 1), (0, 0, 1, 0), (-0.0, -1, -0.0, -0.0), (0.5, -0.5, 0.5, -0.5), (0, 0, -(0.5**0.5), 0.5**0.5))
FIELDS = ("normal", "point_a", "point_b", "points_a", "points_b")


def _pose(place: NDArray[np.float64], k: int) -> cm.Pose:
    if k % 4 == 0:
        return cm.Pose(np.round(place), TURNS[k // 4 % len(TURNS)])
    turn = RNG.normal(size=4)
    return cm.Pose(place, turn / np.linalg.norm(turn))


def _as_compound(shape: cm.Sphere) -> list[tuple[cm.Sphere, cm.Pose]]:
    return [(shape, cm.Pose())]


@pytest.mark.parametrize("far", [0.0, 1e6])
def test_a_contact_has_the_bits_of_the_general_search(far: float) -> None:
    for k, (a, b) in enumerate((a, b) for a in SOLIDS for b in SOLIDS for _ in range(6)):
        pose_a, pose_b = (_pose(far + RNG.uniform(-1.2, 1.2, 3), k + side) for side in range(2))
        one = cm.contact(a, pose_a, b, pose_b)
        other = cm.contact(_as_compound(a), pose_a, _as_compound(b), pose_b)
        assert (one.signed_distance, one.error_bound) == (other.signed_distance, other.error_bound)
        for field in FIELDS:
            np.testing.assert_array_equal(getattr(one, field), getattr(other, field), err_msg=f"{a} {b} {field}")
        assert cm.overlap(a, pose_a, b, pose_b) == other.overlaps
        assert cm.distance(a, pose_a, b, pose_b) == other.signed_distance


def test_a_time_of_impact_has_the_bits_of_the_general_search() -> None:
    seen = set()
    for k, (a, b) in enumerate((a, b) for a in SOLIDS for b in SOLIDS for _ in range(2)):
        place, speed, spin = RNG.normal(size=(3, 3))
        far = 3.0 * place / np.linalg.norm(place)
        motion_a = cm.Motion(_pose(np.zeros(3), k), angular=spin * (k % 3))
        motion_b = cm.Motion(_pose(far, k + 1), 0.3 * speed - far, 0.5 * spin, acceleration=(k % 2) * speed)
        one = cm.time_of_impact(a, motion_a, b, motion_b, separation=0.1 * (k % 2))
        other = cm.time_of_impact(_as_compound(a), motion_a, _as_compound(b), motion_b, separation=0.1 * (k % 2))
        assert (one.status, one.lower, one.upper) == (other.status, other.lower, other.upper)
        seen.add(one.status)
        if one.contact is not None and other.contact is not None:
            assert one.contact.signed_distance == other.contact.signed_distance
            np.testing.assert_array_equal(one.contact.point_b, other.contact.point_b)
        else:
            assert one.contact is other.contact
    assert seen >= {"hit", "clear"}


def test_shapes_that_touch_at_the_start_are_followed_as_before() -> None:
    box, ball = cm.Box((1, 1, 1)), cm.Sphere(0.5)
    part = cm.time_of_impact(box, cm.Motion(cm.Pose()), ball, cm.Motion(cm.Pose((1, 0, 0)), (1, 0, 0)))
    meet = cm.time_of_impact(box, cm.Motion(cm.Pose()), ball, cm.Motion(cm.Pose((1, 0, 0)), (-1, 0, 0)))
    inside = cm.time_of_impact(box, cm.Motion(cm.Pose()), ball, cm.Motion(cm.Pose((0.5, 0, 0))))
    assert (part.status, meet.status, inside.status) == ("clear", "hit", "hit")
    assert inside.contact is not None and inside.contact.signed_distance == -0.5


def test_hulls_larger_than_the_memory_enlarge_it() -> None:
    points = RNG.normal(size=(2000, 3))
    hull = cm.ConvexHull(points / np.linalg.norm(points, axis=1)[:, None])
    pose_a, pose_b = cm.Pose(), cm.Pose((0, 0, 2.5))
    assert (
        cm.contact(hull, pose_a, hull, pose_b).signed_distance
        == cm.contact(_as_compound(hull), pose_a, _as_compound(hull), pose_b).signed_distance
    )
    assert cm.time_of_impact(hull, cm.Motion(pose_a), hull, cm.Motion(pose_b, (0, 0, -1))).status == "hit"


def test_threads_do_not_share_memory() -> None:
    pairs = [(SOLIDS[k % len(SOLIDS)], SOLIDS[k // 3 % len(SOLIDS)], _pose(RNG.normal(size=3), k)) for k in range(2000)]

    def distance(pair: tuple[cm.Sphere, cm.Sphere, cm.Pose]) -> float:
        return cm.contact(pair[0], cm.Pose(), pair[1], pair[2]).signed_distance

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(distance, pairs)) == [distance(pair) for pair in pairs]


def test_wrong_arguments_get_the_errors_of_the_general_search() -> None:
    box, pose = cm.Box((1, 1, 1)), cm.Pose()
    cm.contact(box, pose, box, pose)
    with pytest.raises(cm.PoseError, match=r"pose B: expected a Pose, .*, got Motion"):
        cm.contact(box, pose, box, cm.Motion(pose))  # type: ignore[arg-type]
    with pytest.raises(cm.PoseError, match="motion A: expected a Motion or a Trajectory, got Pose"):
        cm.time_of_impact(box, pose, box, cm.Motion(pose))  # type: ignore[arg-type]
    with pytest.raises(cm.ShapeError, match="shape A: expected a shape"):
        cm.contact(pose, pose, box, pose)  # type: ignore[arg-type]
    with pytest.raises(cm.InputError, match="model"):
        cm.contact(box, pose, box, pose, model="exactly")
