"""Trajectories against SciPy's splines and rotations, the exponential of a twist, and inputs that are refused."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import BPoly, CubicHermiteSpline
from scipy.linalg import expm, logm
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation, Slerp

import collision_monitor as cm
from collision_monitor.errors import PoseError
from collision_monitor.motion import curves
from collision_monitor.motion.curves import CURVE_TOLERANCE
from collision_monitor.motion.trajectory import MOST_POINTS

Array = NDArray[np.float64]
LINE = [(0, 0, 0), (1, 0, 0), (1, 4, 0)]


def points(rng: np.random.Generator, count: int) -> tuple[Array, Array, Array]:
    """Times (N,), poses (N, 7) and twists (N, 6) of a random plan."""
    times = np.cumsum(rng.uniform(0.1, 0.5, count)) - 0.3
    position = np.cumsum(rng.normal(0.0, 0.3, (count, 3)), axis=0)
    quaternion = Rotation.random(count, random_state=rng).as_quat()
    return times, np.concatenate([position, quaternion], axis=1), rng.normal(size=(count, 6))


def matrix(row: Array) -> Array:
    return cm.Pose(row[:3], row[3:]).matrix


def expected(times: Array, poses: Array, twists: Array, between: str, t: float) -> Array:
    """The pose (4, 4) at a time, by other means."""
    t = float(np.clip(t, times[0], times[-1]))
    k = min(int(np.searchsorted(times, t, side="right")) - 1, len(times) - 2)
    s = (t - times[k]) / (times[k + 1] - times[k])
    if between == "arc":
        first, last = matrix(poses[k]), matrix(poses[k + 1])
        return np.array(first @ expm(s * np.real(logm(np.linalg.inv(first) @ last))))
    X = np.eye(4)
    X[:3, :3] = Slerp(times, Rotation.from_quat(poses[:, 3:]))([t])[0].as_matrix()
    X[:3, 3] = poses[k, :3] + s * (poses[k + 1, :3] - poses[k, :3])
    if between == "curve":
        X[:3, 3] = CubicHermiteSpline(times, poses[:, :3], twists[:, :3])(t)
    return X


@pytest.mark.parametrize("between", ["straight", "curve", "arc"])
def test_the_pose_at_any_time_is_that_of_the_spline(between: Any) -> None:
    rng = np.random.default_rng(7)
    within = 1.01 * CURVE_TOLERANCE if between == "curve" else 1e-9
    for _ in range(100):
        times, poses, twists = points(rng, 6)
        path = cm.Trajectory(times, poses, twists, between=between)
        for t in rng.uniform(times[0] - 1.0, times[-1] + 1.0, 5):
            wanted = expected(times, poses, twists, between, t)
            assert path.at(t).position == pytest.approx(wanted[:3, 3], abs=within)
            assert path.at(t).rotation == pytest.approx(wanted[:3, :3], abs=1e-9)
        assert np.array([path.at(t).matrix for t in times]) == pytest.approx(
            np.array([matrix(row) for row in poses]), abs=1e-9
        )


def test_a_curve_is_followed_by_more_pieces_where_it_bends_more() -> None:
    """Each piece stays within its tube, which the largest distance reaches."""
    for speed in (0.01, 1.0, 30.0):
        path = cm.Trajectory([0.0, 1.0], [(0, 0, 0), (1, 0, 0)], [(0, speed, 0), (0, -speed, 0)])
        spline = CubicHermiteSpline([0.0, 1.0], [(0, 0, 0), (1, 0, 0)], [(0, speed, 0), (0, -speed, 0)])
        ts = np.linspace(0.0, 1.0, 20_001)[:-1]
        off = np.linalg.norm(path.rows(ts)[:, :3] - spline(ts), axis=1)
        tube = path.tubes[path.piece(ts)]
        assert (off <= tube + 1e-12).all()
        assert off.max() > 0.9 * tube.max()
        assert tube.max() <= CURVE_TOLERANCE


def quintic(times: Any, points: Any, velocities: Any, accelerations: Any) -> BPoly:
    """The spline of degree 5 by SciPy, in Bernstein form."""
    return BPoly.from_derivatives(times, np.stack([points, velocities, accelerations], axis=1))


@pytest.mark.parametrize("scale", [1e-3, 1.0, 100.0])
def test_a_curve_with_accelerations_is_the_spline_of_degree_5(scale: float) -> None:
    """Each piece stays within its tube, which the largest distance reaches; the orientation is that of the points."""
    rng = np.random.default_rng(17)
    for _ in range(30):
        times, poses, _ = points(rng, 6)
        poses[:, :3] *= scale
        rates = scale * rng.normal(size=(6, 3)), scale * rng.normal(size=(6, 3)) * 3.0
        path = cm.Trajectory(times, poses, rates[0], accelerations=rates[1])
        ts = np.sort(rng.uniform(times[0], times[-1], 4000))
        off = np.linalg.norm(path.rows(ts)[:, :3] - quintic(times, poses[:, :3], *rates)(ts), axis=1)
        tube = path.tubes[path.piece(ts)]
        assert (off <= tube + 1e-12 * scale).all()
        assert off.max() > 0.3 * tube.max()
        assert tube.max() <= CURVE_TOLERANCE or len(path.begins) > 256
        assert path.at(ts[7]).rotation == pytest.approx(
            Slerp(times, Rotation.from_quat(poses[:, 3:]))([ts[7]])[0].as_matrix(), abs=1e-9
        )


def test_accelerations_of_a_cubic_give_the_cubic() -> None:
    times, poses, twists = points(np.random.default_rng(19), 8)
    velocity = twists[:, :3]
    for k in range(7):
        h = times[k + 1] - times[k]
        ends = CubicHermiteSpline(times[k : k + 2], poses[k : k + 2, :3], velocity[k : k + 2]).derivative(2)
        given = np.array([ends(times[k]), ends(times[k + 1])])
        two = times[k : k + 2], poses[k : k + 2], velocity[k : k + 2]
        cubic, degree_5 = cm.Trajectory(*two), cm.Trajectory(*two, accelerations=given)
        assert degree_5.begins == pytest.approx(cubic.begins, abs=1e-12 * h)
        assert degree_5.numbers == pytest.approx(cubic.numbers, rel=1e-9, abs=1e-9)


def test_a_body_on_a_curve_of_degree_5_meets_a_ball_when_it_does() -> None:
    """Against a root of the polynomial: a lift that starts and ends at rest, of minimum jerk."""
    lift = cm.Trajectory([0, 2], [(0, 0, 0), (0, 0, 3)], np.zeros((2, 3)), accelerations=np.zeros((2, 3)))
    found = cm.time_of_impact(cm.Sphere(0.25), lift, cm.Sphere(0.25), cm.Motion(cm.Pose((0, 0, 2.0))), horizon=3.0)
    s = brentq(lambda s: 3.0 * (10 * s**3 - 15 * s**4 + 6 * s**5) - 1.5, 0.0, 1.0)
    assert found.status == "hit" and found.lower <= 2.0 * s <= found.upper
    assert found.upper - found.lower < 1e-5


def test_what_holds_after_the_last_point() -> None:
    assert cm.Trajectory([0, 1, 3], LINE).at(9.0).position.tolist() == [1, 4, 0]
    assert cm.Trajectory([0, 1, 3], LINE, then="go on").at(9.0).position.tolist() == [1, 16, 0]
    curve = cm.Trajectory([0, 1], [(0, 0, 0), (1, 0, 0)], [(0, 0, 0), (0, 2, 0)], then="go on")
    assert curve.at(3.0).position == pytest.approx([1, 4, 0])
    turn = cm.Pose((1, 1, 0), (0, 0, np.sin(np.pi / 4), np.cos(np.pi / 4)))
    circle = cm.Trajectory([0, 1], [cm.Pose(), turn], between="arc", then="go on")
    assert circle.at(4.0).position == pytest.approx([0, 0, 0], abs=1e-12)
    assert circle.at(2.0).position == pytest.approx([0, 2, 0], abs=1e-12)


def test_poses_in_every_form_and_a_plan_that_began_before() -> None:
    rows = np.array([[*each, 0, 0, 0, 1] for each in LINE], float)
    whole = cm.Trajectory([-1, 0, 2], rows)
    for poses in (LINE, np.array(LINE, float), [cm.Pose(each) for each in LINE], list(rows)):
        other = cm.Trajectory([-1, 0, 2], poses)
        assert (other.numbers == whole.numbers).all()
    assert whole.pose.position.tolist() == [1, 0, 0]
    assert cm.Trajectory([5, 6], LINE[:2]).pose.position.tolist() == [0, 0, 0]
    assert repr(whole) == "Trajectory(3 points, -1 to 2 s, then rest)"


@pytest.mark.parametrize(
    ("arguments", "named", "text"),
    [
        (([0, 1, 1], LINE), {}, "times: expected rising ones, got 1 and then 1 at point 2"),
        (([0, 2, 1], LINE), {}, "got 2 and then 1"),
        (([0], LINE[:1]), {}, "times: expected 2 to"),
        ((np.arange(MOST_POINTS + 1), LINE), {}, "times: expected 2 to"),
        (([0, 1, np.nan], LINE), {}, "times: expected finite numbers"),
        (([0, 1, np.inf], LINE), {}, "times: expected finite numbers"),
        (("later", LINE), {}, "times: expected numbers"),
        (([0, 1], LINE), {}, r"poses: expected shape \(2, 7\), one for each time, got \(3, 7\)"),
        (([0, 1, 2], [*LINE[:2], (0, np.nan, 0)]), {}, "poses, point 2"),
        (([0, 1], np.array([[0, 0, 0, 0, 0, 0, 2.0]] * 2)), {}, "quaternions of unit length within 0.001, got 2 at"),
        (([0, 1], np.full((2, 7), np.nan)), {}, "poses: expected finite numbers"),
        (([0, 1], "there"), {}, "poses: expected an array"),
        (([0, 1e-9, 1], LINE), {}, "expected at most 100000 m/s between two points, got 1e.09 from point 0 on"),
        (([0, 1, 2], LINE, np.zeros((2, 6))), {}, r"twists: expected shape \(3, 6\)"),
        (([0, 1, 2], LINE, np.full((3, 6), 1e18)), {}, "twists: expected finite numbers up to 100000"),
        (([0, 1, 2], LINE), {"between": "curve"}, "twists: expected linear velocities"),
        (([0, 1, 2], LINE, np.zeros((3, 3))), {"accelerations": LINE[:2]}, r"accelerations: expected shape \(3, 3\)"),
        (([0, 1, 2], LINE), {"accelerations": np.zeros((3, 3))}, "accelerations: expected a curve with twists"),
        (([0, 1, 2], LINE, np.zeros((3, 3))), {"accelerations": np.full((3, 3), np.nan)}, "accelerations: expected f"),
        (([0, 1, 2], LINE), {"between": "quintic"}, "between: expected one of 'straight', 'arc', 'curve'"),
        (([0, 1, 1e19], LINE), {}, r"times: expected finite numbers up to 1e\+18, got 1e\+19 at point 2"),
        (([0, 1e-200, 1], LINE, np.full((3, 3), 1e5)), {}, "times: expected at least 1e-12 s between two points, got"),
        (([0, 5e-324, 1], LINE), {}, "times: expected at least 1e-12 s between two points, got"),
        (([0, 1], np.array(5.0)), {}, "poses: expected an array"),
        (([0, 1], np.full((2, 7), 1e200)), {}, "poses: expected finite numbers up to"),
        (([0, 1, 2], LINE), {"between": np.array(["arc", "curve"])}, "between: expected one of"),
        (([0, 1, 2], LINE), {"then": np.array(["rest", "rest"])}, "then: expected one of"),
        (([0, 1, 2], LINE), {"then": "explode"}, "then: expected one of 'rest', 'go on', 'unknown'"),
    ],
)
def test_what_is_no_plan_is_refused(arguments: tuple[Any, ...], named: dict[str, Any], text: str) -> None:
    with pytest.raises(PoseError, match=text):
        cm.Trajectory(*arguments, **named)


@pytest.mark.parametrize("time", [np.nan, np.inf, "soon", None, [1.0, 2.0]])
def test_a_time_that_is_none_is_refused(time: Any) -> None:
    with pytest.raises(PoseError, match="time: expected a finite number of s, got"):
        cm.Trajectory([0, 1], LINE[:2]).at(time)


@pytest.mark.parametrize("between", ["straight", "curve", "arc"])
def test_copies_are_equal_to_the_bit_and_never_change(between: Any) -> None:
    times, poses, twists = points(np.random.default_rng(3), 9)
    path = cm.Trajectory(times, poses, twists, between=between, then="go on")
    for other in (copy.copy(path), copy.deepcopy(path), pickle.loads(pickle.dumps(path))):
        for name in ("times", "poses", "twists", "begins", "numbers", "tubes"):
            assert getattr(other, name).tobytes() == getattr(path, name).tobytes()
            assert not getattr(other, name).flags.writeable
        assert (other.between, other.then, repr(other)) == (between, "go on", repr(path))


def test_quaternions_of_unit_length_stay_as_they_are_to_the_bit() -> None:
    poses = [cm.Pose((0, 0, 0), each) for each in Rotation.random(50, random_state=1).as_quat()]
    path = cm.Trajectory(range(50), poses)
    assert [tuple(row) for row in path.poses.tolist()] == [each.numbers for each in poses]


def test_orientations_that_differ_by_round_off_do_not_turn() -> None:
    """Each is that of the first, by another way."""
    turns = [Rotation.from_euler("z", k * 0.7) * Rotation.from_euler("z", 0.3 - k * 0.7) for k in range(40)]
    path = cm.Trajectory(range(40), np.concatenate([np.zeros((40, 3)), [each.as_quat() for each in turns]], axis=1))
    assert len(np.unique(path.poses[:, 3:], axis=0)) > 1
    assert not path.angular.any()
    turned = cm.Trajectory([0, 1], [cm.Pose(), cm.Pose.from_euler(0, 0, 1e-13)])
    assert turned.angular[1] == pytest.approx([0, 0, 1e-13], abs=1e-20)


def test_a_wild_curve_of_many_points_has_wider_tubes_in_place_of_more_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(curves, "MOST_PIECES", 300)
    rng = np.random.default_rng(11)
    times, poses, velocities = np.arange(50) * 1.0, rng.normal(size=(50, 3)), rng.normal(size=(50, 3)) * 100.0
    path = cm.Trajectory(times, poses, velocities)
    assert len(path.begins) <= 300 + 50 + 2
    assert path.tubes.max() > CURVE_TOLERANCE
    ts = rng.uniform(0.0, 49.0, 5000)
    off = np.linalg.norm(path.rows(ts)[:, :3] - CubicHermiteSpline(times, poses, velocities)(ts), axis=1)
    assert (off <= path.tubes[path.piece(ts)] + 1e-9).all()


@pytest.mark.parametrize("between", ["straight", "curve", "arc"])
def test_in_the_plane_a_plan_has_neither_height_nor_tilt_and_no_jumps(between: Any) -> None:
    rng = np.random.default_rng(13)
    position, yaw = rng.normal(size=(8, 3)), np.cumsum(rng.uniform(-1.0, 1.0, 8))
    tilt = np.stack([yaw, *rng.uniform(-0.4, 0.4, (2, 8))], axis=1)
    whole, flat = (
        cm.Trajectory(
            np.arange(8.0),
            np.concatenate([position * scale, Rotation.from_euler("ZYX", tilt * angles).as_quat()], axis=1),
            rng.normal(size=(8, 3)) * scale if between == "curve" else None,
            between=between,
        )
        for scale, angles in (((1, 1, 1), (1, 1, 1)), ((1, 1, 0), (1, 0, 0)))
    )
    found = whole.flat()
    for t in np.linspace(0.0, 7.0, 50):
        assert found.at(t).rotation[2] == pytest.approx([0, 0, 1]) and found.at(t).position[2] == 0.0
        if between == "straight":
            assert found.at(t).position == pytest.approx(flat.at(t).position)
    for k in range(1, 7):
        before, after = found.at(k - 1e-12), found.at(k)
        assert before.matrix == pytest.approx(after.matrix, abs=1e-9)
    assert found is whole.flat()
    with pytest.raises(PoseError, match=r"expected z to point up for a shape of the plane, got .* at point 1"):
        cm.Trajectory([0, 1], [cm.Pose(), cm.Pose((0, 0, 0), (1, 0, 0, 0))]).flat()


@pytest.mark.parametrize("span", [1e-6, 1.0, 1e6, 1e9, 1e12])
def test_an_arc_is_the_same_in_every_unit_of_time(span: float) -> None:
    """It was straight if the body took more than 1e9 s for a radian, as with times in nanoseconds, and then jumped."""
    rng = np.random.default_rng(29)
    for size in (1.0, 1e-3):
        end = cm.Pose(rng.normal(size=3) * 0.01, Rotation.from_rotvec(rng.normal(size=3) * 0.005 * size).as_quat())
        path = cm.Trajectory([0, span], [cm.Pose(), end], between="arc")
        for part in (0.3, 0.5, 1.0 - 1e-9):
            wanted = expm(part * np.real(logm(end.matrix)))
            assert path.at(part * span).matrix == pytest.approx(wanted, abs=1e-9)


def test_a_pose_that_turns_faster_than_any_body_is_refused() -> None:
    turned = cm.Pose((0, 0, 0), (0, 0, 1, 0))
    with pytest.raises(PoseError, match="rad/s between two points"):
        cm.Trajectory([0, 1e-6], [cm.Pose(), turned])
    with pytest.raises(AttributeError, match="never changes"):
        cm.Trajectory([0, 1], LINE[:2]).times = np.zeros(2)  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        cm.Trajectory([0, 1], LINE[:2]).poses[0, 0] = 1.0
