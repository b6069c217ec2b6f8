"""Impacts of bodies that follow trajectories: samples of their poses, closed forms, and plans cut in other places."""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np
import pytest
from contact_intervals import SHAPES as SOLIDS
from contact_intervals import check_intervals
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.errors import PoseError, UnsupportedError

Array = NDArray[np.float64]

SHAPES: dict[str, Any] = {"sphere": cm.Sphere(0.3), **SOLIDS}


def plan(rng: np.random.Generator, *, between: Any, then: Any = "rest", planar: bool = False) -> cm.Trajectory:
    """A plan within some metres that turns, stops at times, and begins before or after now."""
    count = int(rng.integers(3, 9))
    times = np.cumsum(rng.uniform(0.1, 0.6, count)) - rng.uniform(0.0, 0.6)
    position = rng.normal(0.0, 0.5, 3) + np.cumsum(rng.normal(0.0, 0.5, (count, 3)), axis=0)
    turns = np.cumsum(rng.normal(0.0, 0.7, (count, 3)), axis=0)
    if planar:
        position[:, 2], turns[:, :2] = 0.0, 0.0
    stays = rng.integers(1, count)
    position[stays], turns[stays] = position[stays - 1], turns[stays - 1]
    poses = np.concatenate([position, Rotation.from_rotvec(turns).as_quat()], axis=1)
    twists = rng.normal(size=(count, 3)) if between == "curve" else None
    return cm.Trajectory(times, poses, twists, between=between, then=then)


@pytest.mark.parametrize("between", ["straight", "arc", "curve"])
@pytest.mark.parametrize("kinds", list(zip(SHAPES, [*list(SHAPES)[3:], *list(SHAPES)[:3]], strict=True)), ids="-".join)
def test_dense_samples_find_the_same_intervals(kinds: tuple[str, str], between: str) -> None:
    rng = np.random.default_rng(sum(map(ord, "".join(kinds) + between)))
    a, b = SHAPES[kinds[0]], SHAPES[kinds[1]]
    hits = 0
    for _ in range(6):
        one, other = plan(rng, between=between), plan(rng, between=between, then="go on")
        impact = cm.time_of_impact(a, one, b, other, 3.0)
        found = cm.impacts(a, one, b, other, 3.0)
        assert bool(found) == (impact.status != "clear")
        if found:
            hits += 1
            assert found[0].entry[0] == pytest.approx(impact.lower, abs=1e-4)
        check_intervals(found, a, one, b, other, 3.0, 151)
    assert hits > 0


def test_two_plans_that_cross_do_not_meet_if_one_waits() -> None:
    size = cm.Box((0.8, 0.8, 0.8))
    east = cm.Trajectory([0, 4], [(-2, 0, 0), (2, 0, 0)])
    north = cm.Trajectory([0, 4], [(0, -2, 0), (0, 2, 0)])
    waits = cm.Trajectory([0, 1, 3, 6], [(0, -2, 0), (0, -1, 0), (0, -1, 0), (0, 2, 0)])
    impact = cm.time_of_impact(size, east, size, north, 10.0)
    assert impact.status == "hit" and impact.lower == pytest.approx(1.2, abs=1e-5)
    assert impact.segment == (0, 0)
    assert cm.time_of_impact(size, east, size, waits, 10.0).status == "clear"
    assert cm.time_of_impact(size, east, size, waits, 10.0, separation=0.25).status == "hit"
    assert cm.time_of_impact(size, cm.Motion((0, 0, 0)), size, waits, 10.0).segment == (None, 2)


def test_entry_and_exit_are_certain_to_a_microsecond() -> None:
    rng = np.random.default_rng(5)
    for _ in range(40):
        beside, x = rng.uniform(0.0, 0.8), rng.uniform(2.0, 4.0)
        path = cm.Trajectory([0, 1, 2], [(-x, beside, 0), (-1.5, beside, 0), (6, beside, 0)])
        (found,) = cm.impacts(cm.Sphere(0.6), path, cm.Sphere(0.4), cm.Motion((0, 0, 0)), 3.0)
        half = np.sqrt(1.0 - beside**2)
        enters, leaves = 1.0 + (1.5 - half) / 7.5, 1.0 + (1.5 + half) / 7.5
        assert found.entry[0] - 1e-12 <= enters <= found.entry[1] + 1e-12 and found.entry[1] - found.entry[0] < 1e-6
        assert found.exit[0] - 1e-12 <= leaves <= found.exit[1] + 1e-12 and found.exit[1] - found.exit[0] < 1e-6


@pytest.mark.parametrize("kinds", [("box", "capsule"), ("mesh", "hull"), ("sphere", "compound")], ids="-".join)
def test_a_motion_cut_into_points_meets_at_the_same_time(kinds: tuple[str, str]) -> None:
    rng = np.random.default_rng(17)
    a, b = SHAPES[kinds[0]], SHAPES[kinds[1]]
    met = 0
    for _ in range(60):
        pose = cm.Pose(rng.normal(size=3) * 0.3 + (2, 0, 0), Rotation.random(random_state=rng).as_quat())
        frame = "body" if rng.random() < 0.5 else "world"
        between = "arc" if frame == "body" else "straight"
        motion = cm.Motion(pose, pose.rotation.T @ (-1.5, 0, 0) if frame == "body" else (-1.5, 0, 0),
                           rng.normal(size=3) * 0.5, frame=frame)  # fmt: skip
        other = cm.Motion((0, 0, 0), rng.normal(size=3) * 0.1, rng.normal(size=3) * 0.3)
        times = np.unique([0.0, 3.0, *rng.uniform(0.0, 3.0, rng.integers(0, 40))])
        path = cm.Trajectory(times, [motion.at(t) for t in times], between=between)
        whole, cut = (cm.time_of_impact(a, each, b, other, 3.0) for each in (motion, path))
        swapped = cm.time_of_impact(b, other, a, path, 3.0)
        assert whole.status == cut.status == swapped.status
        if whole.status == "hit":
            met += 1
            assert cut.lower <= whole.upper + 1e-9 and whole.lower <= cut.upper + 1e-9
            assert swapped.lower <= whole.upper + 1e-9 and whole.lower <= swapped.upper + 1e-9
    assert met > 20


def test_a_body_that_slides_on_the_floor_along_its_plan_has_no_impact_with_it() -> None:
    floor, box = cm.HalfSpace((0, 0, 1)), cm.Box((0.4, 0.4, 0.2))
    path = [(0, 0, 0.1), (1, 0, 0.1), (1, 1, 0.1), (1, 1, 1.0), (1, 1, 0.05)]
    still = cm.Motion((0, 0, 0))
    assert cm.time_of_impact(box, cm.Trajectory([0, 1, 2], path[:3]), floor, still, 5.0).status == "clear"
    impact = cm.time_of_impact(box, cm.Trajectory([0, 1, 2, 3, 4], path), floor, still, 5.0)
    assert impact.status == "hit" and impact.lower == pytest.approx(3.0 + 0.9 / 0.95, abs=1e-5)
    assert impact.segment == (3, None)
    turns = cm.Trajectory([0, 1], [cm.Pose(), cm.Pose((0, 0, 0), (0, 0, 1, 0))])
    with pytest.raises(UnsupportedError, match="cannot turn"):
        cm.time_of_impact(floor, turns, box, still)


@pytest.mark.parametrize("floor", [cm.HalfSpace((0, 0, 1)), cm.Box((40, 40, 2))], ids=["half-space", "slab"])
@pytest.mark.parametrize("body", [cm.Box((0.4, 0.4, 0.2)), cm.Sphere(0.1), cm.Cylinder(0.3, 0.2)], ids=str)
def test_what_slides_on_a_floor_along_an_arc_has_no_impact_with_it_in_either_order(floor: Any, body: Any) -> None:
    rng = np.random.default_rng(31)
    for _ in range(10):
        X = cm.Pose(rng.normal(size=3), Rotation.random(random_state=rng).as_quat())
        down = X @ cm.Pose((0, 0, -1.0 if isinstance(floor, cm.Box) else 0.0))
        bends, z = [cm.Pose()], 0.1
        for turn in rng.uniform(-0.7, 0.7, 4):
            bends.append(bends[-1] @ cm.Pose.from_euler(0, 0, turn, (0.3, 0.3 * turn / 2, 0)))
        path = cm.Trajectory(range(5), [X @ cm.Pose((0, 0, z)) @ each for each in bends], between="arc")
        robot = cm.Motion(X @ cm.Pose((0, 0, z)), (1, 0, 0), (0, 0, 0.8), (-0.2, 0, 0), frame="body", stops=True)
        dips = cm.Trajectory(
            range(5), [X @ cm.Pose((0, 0, z - 0.05 * (k == 4))) @ each for k, each in enumerate(bends)]
        )
        for moves in (path, robot):
            assert cm.time_of_impact(body, moves, floor, cm.Motion(down), 6.0).status == "clear"
            assert cm.time_of_impact(floor, cm.Motion(down), body, moves, 6.0).status == "clear"
        for found in (
            cm.time_of_impact(body, dips, floor, cm.Motion(down), 6.0),
            cm.time_of_impact(floor, cm.Motion(down), body, dips, 6.0),
        ):
            assert found.status == "hit" and found.lower == pytest.approx(3.0, abs=1e-4)


def test_what_comes_after_an_unknown_end_is_unresolved() -> None:
    path, still = cm.Trajectory([0, 1], [(0, 0, 0), (1, 0, 0)], then="unknown"), cm.Motion((5, 0, 0))
    ball = cm.Sphere(0.5)
    impact = cm.time_of_impact(ball, path, ball, still, 4.0)
    assert (impact.status, impact.lower, impact.upper) == ("unresolved", 1.0, inf)
    assert cm.time_of_impact(ball, path, ball, still, 1.0).status == "clear"
    (found,) = cm.impacts(ball, path, ball, still, 4.0)
    assert found.entry == (1.0, inf)
    past = cm.Trajectory([-2, -1], [(0, 0, 0), (1, 0, 0)], then="unknown")
    assert cm.time_of_impact(ball, past, ball, still, 4.0).lower == 0.0


def test_plane_shapes_follow_plans_in_the_plane() -> None:
    rng = np.random.default_rng(23)
    disc, met = cm.Circle(0.4), 0
    for _ in range(40):
        one, other = plan(rng, between="straight", planar=True), plan(rng, between="straight", planar=True)
        impact = cm.time_of_impact(disc, one, disc, other, 3.0)
        solid = cm.time_of_impact(cm.Sphere(0.4), one, cm.Sphere(0.4), other, 3.0)
        assert impact.status == solid.status
        met += impact.status == "hit"
        if met and impact.status == "hit":
            assert impact.lower == pytest.approx(solid.lower, abs=1e-4)
    assert met > 5


def test_a_trajectory_needs_the_exact_method_and_a_motion_is_named() -> None:
    path, still, ball = cm.Trajectory([0, 1], [(0, 0, 0), (1, 0, 0)]), cm.Motion((5, 0, 0)), cm.Sphere(0.5)
    with pytest.raises(UnsupportedError, match="Trajectory needs conservative_advancement"):
        cm.time_of_impact(ball, path, ball, still, method="bisection")
    with pytest.raises(PoseError, match="motion B: expected a Motion or a Trajectory, got Pose"):
        cm.time_of_impact(ball, path, ball, cm.Pose())  # type: ignore[arg-type]


def test_a_long_plan_costs_memory_and_hardly_any_time() -> None:
    """A plan of 10,000 points, and its first 30, which reach beyond the horizon, give the same times."""
    times = np.linspace(0.0, 1000.0, 10_001)
    path = cm.Trajectory(times, np.stack([times, np.sin(times), 0.0 * times], axis=1))
    short = cm.Trajectory(times[:30], path.poses[:30])
    still, ball = cm.Motion((1.5, 1.0, 0)), cm.Sphere(0.1)
    one, other = (cm.time_of_impact(ball, each, ball, still, 2.0) for each in (path, short))
    assert (one.lower, one.upper) == (other.lower, other.upper)
