"""Each kind of message, from its bytes to the states and descriptions that the monitor gets."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from fed import Fed, in_world
from foreign_bag import SECOND, START, T, marker, markers, odometry, pose_stamped, transforms
from foreign_messages import (
    CYLINDER,
    POLYGON,
    detection,
    detections,
    footprint,
    laser_scan,
    point_cloud,
    predicted_objects,
    track,
    tracked_objects,
)
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from collision_monitor.errors import InputError
from collision_monitor.records import StateFlag
from collision_monitor.sources.ground.covariances import usable_blocks
from collision_monitor.sources.ground.frames import FrameMotion
from collision_monitor.sources.ground.scene_states import squares
from collision_monitor.sources.messages.clouds import read_cloud_points, thinned
from collision_monitor.sources.messages.laser_scans import read_beams

STEP = 50_000_000
SPHERE = {"sphere": 1.0}


def at(k: int) -> int:
    return START + k * STEP


def with_covariance(message: tuple[str, Any], pose: Any = None, twist: Any = None) -> tuple[str, Any]:
    _, content = message
    if pose is not None:
        content.pose.covariance = np.asarray(pose, np.float64).ravel()
    if twist is not None:
        content.twist.covariance = np.asarray(twist, np.float64).ravel()
    return message


# -- covariances


@given(st.integers(0, 1000))
def test_covariances_of_odometry_are_turned_to_the_axes_of_the_map(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A, B = rng.normal(size=(2, 6, 6))
    A, B = A @ A.T, B @ B.T
    q_FB, q_WF = (Rotation.random(random_state=rng) for _ in range(2))
    fed = Fed({"cart": {"topic": "/odom", "shape": SPHERE}})
    fed.give("/tf_static", START, transforms(START, ("map", "odom", (1, 2, 3), q_WF.as_quat())))
    message = odometry("odom", START, (0, 0, 0), q_FB.as_quat(), (1, 0, 0), (0, 0, 1))
    fed.give("/odom", START, with_covariance(message, A, B))
    R_WF, R_WB = q_WF.as_matrix(), (q_WF * q_FB).as_matrix()
    position, velocity = squares(fed.covariances.reshape(2, 6))
    np.testing.assert_allclose(position, R_WF @ A[:3, :3] @ R_WF.T, atol=1e-9)
    np.testing.assert_allclose(velocity, R_WB @ B[:3, :3] @ R_WB.T, atol=1e-9)
    row = fed.rows[0]
    assert row["orientation_stddev"] == pytest.approx(math.sqrt(np.linalg.eigvalsh(A[3:, 3:])[-1]))
    assert row["angular_velocity_stddev"] == pytest.approx(math.sqrt(np.linalg.eigvalsh(B[3:, 3:])[-1]))
    assert not fed.refused


@pytest.mark.parametrize(
    ("matrix", "valid"),
    [
        (np.zeros((6, 6)), True),  # none
        (np.diag([-1.0, 0, 0, 0, 0, 0]), True),  # "not known", as in sensor_msgs
        (np.diag([1e6] * 6), True),  # placeholders of drivers
        (np.full((6, 6), np.nan), False),
        (np.diag([1.0, -2.0, 1, 1, 1, 1]), False),
        (np.triu(np.ones((6, 6))), False),
        (np.eye(6) + 1e300 * (1 - np.eye(6)), False),
    ],
)
def test_covariances_that_are_none(matrix: Any, valid: bool) -> None:
    triangles, stddev, _, is_valid = usable_blocks(matrix.reshape(1, 36))
    assert is_valid[0] == valid
    assert stddev[0] == 0.0
    assert not np.nan_to_num(triangles).any()
    fed = Fed({"cart": {"topic": "/odom", "shape": SPHERE}})
    fed.give(
        "/odom", START, with_covariance(odometry("map", START, (0, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0)), matrix)
    )
    assert len(fed.rows) == 1
    assert bool(fed.refused) is not valid
    assert all(
        "expected a symmetric matrix without negative eigenvalues; it was ignored" in text for text in fed.refused
    )


def test_an_axis_that_is_not_measured_leaves_the_others() -> None:
    planar = np.diag([0.04, 0.09, 1e6, 1e6, 1e6, 0.01])
    triangles, stddev, yaw_only, valid = usable_blocks(planar.reshape(1, 36))
    assert valid[0]
    assert yaw_only[0]
    assert triangles[0].tolist() == [0.04, 0, 0, 0.09, 0, 0]
    assert stddev[0] == pytest.approx(0.1)


TILTED = Rotation.from_euler("x", 0.1).as_quat()
YAW = np.diag([0.01, 0.01, 0.0, 0.0, 0.0, 0.04])


@pytest.mark.parametrize(
    ("pose", "twist", "frame", "body", "is_flagged"),
    [
        (YAW, YAW, (0, 0, 0, 1), (0, 0, 0.6, 0.8), True),
        (YAW + np.diag([0, 0, 1e6, 1e6, 1e6, 0]), None, (0, 0, 0.6, 0.8), (0, 0, 0, 1), True),  # not measured
        (YAW + np.diag([0, 0, 0, 1e-6, 1e-6, 0]), YAW, (0, 0, 0, 1), (0, 0, 0, 1), True),  # 1 mrad
        (YAW + np.diag([0, 0, 0, 1e-4, 0, 0]), YAW, (0, 0, 0, 1), (0, 0, 0, 1), False),
        (YAW, 0.1 * np.eye(6), (0, 0, 0, 1), (0, 0, 0, 1), False),
        (YAW, None, TILTED, (0, 0, 0, 1), False),  # the axis of the map is another one
        (YAW, YAW, (0, 0, 0, 1), TILTED, False),  # twists are along the axes of the body
        (YAW, None, (0, 0, 0, 1), TILTED, True),
        (None, None, (0, 0, 0, 1), (0, 0, 0, 1), False),
    ],
)
def test_errors_of_yaw_alone_are_flagged(pose: Any, twist: Any, frame: Any, body: Any, is_flagged: bool) -> None:
    fed = Fed({"cart": {"topic": "/odom", "shape": SPHERE}})
    fed.give("/tf_static", START, transforms(START, ("map", "odom", (1, 2, 3), frame)))
    message = odometry("odom", START, (0, 0, 0), body, (1, 0, 0), (0, 0, 1))
    fed.give("/odom", START, with_covariance(message, pose, twist))
    assert bool(fed.rows[0]["flags"] & StateFlag.YAW_ONLY) == is_flagged
    if pose is not None:
        assert fed.rows[0]["orientation_stddev"] == pytest.approx(0.2)


# -- steps


def test_states_are_brought_to_the_stamp_of_the_step_along_their_motion() -> None:
    fed = Fed({"cart": {"topic": "/odom", "shape": SPHERE}, "other": {"topic": "/b", "shape": SPHERE}}, rate=10)
    w, radius = 0.7, 3.0 / 0.7

    def place(t: float) -> tuple[float, float, float]:
        return radius * math.sin(w * t), radius * (1.0 - math.cos(w * t)), 0.0

    for k in range(12):
        t = 0.03 * k
        stamp = START + round(t * SECOND)
        q = (0, 0, math.sin(w * t / 2), math.cos(w * t / 2))
        fed.give("/odom", stamp, odometry("map", stamp, place(t), q, (3, 0, 0), (0, 0, w)))
        fed.give("/b", stamp, pose_stamped("map", stamp - 1_000_000, (0, -2 * (t - 0.001), 0)))
    assert [step.stamp_ns - START for step in fed.steps] == [0, 100_000_000, 200_000_000, 300_000_000]
    for step in fed.steps[1:]:
        t = (step.stamp_ns - START) / SECOND
        cart, other = step.states
        np.testing.assert_allclose(cart["position"], place(t), atol=1e-9)
        np.testing.assert_allclose(cart["quaternion"][2:], (math.sin(w * t / 2), math.cos(w * t / 2)), atol=1e-9)
        np.testing.assert_allclose(other["position"], (0, -2 * t, 0), atol=1e-9)
        np.testing.assert_allclose(other["linear"], (0, -2, 0), atol=1e-9)
        assert step.states["flags"].tolist() == [StateFlag.BODY_TWIST, 0]


def test_uncertainty_grows_on_the_way_to_the_step() -> None:
    fed = Fed({"cart": {"topic": "/odom", "shape": SPHERE}, "clock": {"topic": "/c", "shape": SPHERE}}, step="/c")
    block = np.diag([0.04, 0.04, 0.04, 0, 0, 0])
    message = odometry("map", START, (0, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0))
    fed.give("/odom", START, with_covariance(message, block, block))
    fed.give("/c", START, pose_stamped("map", START + SECOND // 2, (0, 0, 0)))
    first = fed.covariances[0]
    assert first[[0, 3, 5]] == pytest.approx([0.04 + 0.25 * 0.04] * 3)
    assert first[[6, 9, 11]] == pytest.approx([0.04] * 3)


def test_a_message_too_old_for_its_step_is_left_out_and_named() -> None:
    fed = Fed(
        {"cart": {"topic": "/odom", "shape": SPHERE}, "clock": {"topic": "/c", "shape": SPHERE}}, step="/c", max_age=0.1
    )
    fed.give("/odom", START, odometry("map", START, (0, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0)))
    fed.give("/c", START, pose_stamped("map", START + SECOND, (0, 0, 0)))
    assert fed.rows["id"].tolist() == [2]
    assert fed.refused == {"cart: its message is older than max_age at its step": 1}


@pytest.mark.parametrize("stepping", [{"rate": 20}, {"step": "/odom"}])
def test_a_slow_monitor_gets_fewer_steps_and_each_has_the_newest_states(stepping: dict[str, Any]) -> None:
    names = {"cart": {"topic": "/odom", "shape": SPHERE}, "other": {"topic": "/b", "shape": SPHERE}}
    fed = Fed(names, **stepping)
    fed.feed.least_period = 0.12
    for k in range(10):
        stamp = at(k)
        fed.give("/odom", stamp, odometry("map", stamp, (k, 0, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)))
        if k % 4 == 1:  # between two steps
            fed.give("/b", stamp, pose_stamped("map", stamp, (0, k, 0)))
    assert [step.stamp_ns for step in fed.steps] == [at(0), at(3), at(6), at(9)]
    assert [step.states["position"][0, 0] for step in fed.steps] == [0, 3, 6, 9]
    assert [len(step.states) for step in fed.steps] == [1, 2, 2, 1]
    fed.feed.least_period = 0.0
    fed.give("/odom", at(10), odometry("map", at(10), (10, 0, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)))
    assert fed.steps[-1].stamp_ns == at(10)


def test_stamps_of_another_clock_are_refused_until_a_second_one_agrees() -> None:
    fed = Fed({"cart": {"topic": "/odom", "shape": SPHERE}}, rate=20)

    received = iter(range(START, START + SECOND, STEP))

    def drive(stamp: int) -> None:
        fed.give("/odom", next(received), odometry("map", stamp, (0, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0)))

    drive(START)
    drive(START + 3600 * SECOND)
    assert list(fed.refused.values()) == [1]
    assert "stamp: expected one within 10 s of the others, got one further away" in next(iter(fed.refused))
    drive(START + STEP)
    drive(START - 100 * SECOND)
    drive(START - 100 * SECOND + STEP)  # a bag that is played again
    assert [step.stamp_ns - START for step in fed.steps] == [0, STEP, -100 * SECOND + STEP]


def test_a_missing_transform_leaves_the_object_out_and_names_the_frame() -> None:
    fed = Fed({"cart": {"topic": "/odom", "shape": SPHERE}})
    fed.give("/odom", START, odometry("odom", START, (0, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0)))
    assert not fed.steps
    assert fed.refused == {"cart: no transform from 'map' to 'odom'; frames known from tf: none": 1}
    fed.give("/odom", START, ("nav_msgs/msg/Odometry", b"\0\1\0\0short"))
    assert any(text.startswith("/odom: expected a nav_msgs/msg/Odometry, cannot be decoded") for text in fed.refused)


def test_bad_numbers_reach_the_monitor_which_refuses_and_counts_them() -> None:
    fed = Fed({"cart": {"topic": "/p", "shape": SPHERE}}, rate=20)
    fed.give("/p", START, pose_stamped("map", START, (np.nan, 0, 0)))
    fed.give("/p", START, pose_stamped("map", at(1), (1, 0, 0)))
    fed.give("/p", START, pose_stamped("map", at(2), (2, 0, 0)))
    assert np.isnan(fed.rows["position"][0, 0])
    assert fed.rows["linear"][2].tolist() == pytest.approx([20, 0, 0])


def test_a_message_that_comes_late_does_not_replace_a_newer_one() -> None:
    fed = Fed({"cart": {"topic": "/odom", "shape": SPHERE}, "clock": {"topic": "/c", "shape": SPHERE}}, step="/c")
    for k in (2, 1):
        fed.give("/odom", START, odometry("map", at(k), (k, 0, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)))
    fed.give("/c", START, pose_stamped("map", at(3), (0, 0, 0)))
    assert fed.rows["position"][0].tolist() == [2, 0, 0]


def test_lines_of_one_topic_that_do_not_fit_leave_the_others() -> None:
    fed = Fed({"good": {"topic": "/p", "shape": SPHERE}, "bad": {"topic": "/p"}})
    problems = fed.feed.bind("/p", "geometry_msgs/msg/PoseStamped")
    assert list(problems) == ["bad"]
    assert "bad, shape: expected one of sphere" in problems["bad"]


# -- tracks


def test_tracks_appear_vanish_and_return_with_their_ids_and_names() -> None:
    fed = Fed(
        {
            "floor": {"static": True, "shape": {"half_space": [0, 0, 1, 0]}},
            "traffic": {"topic": "/t", "forget_after": 0.2},
        }
    )
    for k in range(12):
        seen = [track(1, (k, 0, 0), linear=(20, 0, 0))]
        if k in (2, 3, 5, 11):  # it flickers, and is away for longer than 0.2 s
            seen.append(track(2, (0, 9, 0), label=7, kind=CYLINDER, size=(0.6, 0.6, 1.8)))
        fed.give("/t", at(k), tracked_objects("map", at(k), *seen))
    assert fed.names == ["floor", "traffic_car_1", "traffic_pedestrian_2", "-4", "traffic_pedestrian_2"]
    assert [change.object_id for change in fed.changes] == [1, 3, 4, 4, 4]
    assert fed.rows["linear"][0].tolist() == [20, 0, 0]
    assert not fed.refused


def test_twists_and_covariances_of_tracks_are_turned_from_their_own_axes() -> None:
    q = Rotation.from_rotvec((0, 0, math.pi / 2))
    block = np.diag([0.01, 0.04, 0.09, 0.01, 0.01, 0.01])
    one = track(
        1,
        (1, 2, 3),
        q.as_quat(),
        (5, 0, 0),
        (0, 0, 0.1),
        pose_covariance=block,
        twist_covariance=block,
        acceleration=(2, 0, 0),
    )
    parked = track(2, (9, 9, 9), linear=(0.3, 0, 0), stationary=True)
    fed = Fed({"traffic": {"topic": "/t"}})
    fed.give("/t", START, tracked_objects("map", START, one, parked))
    moving, still = in_world(fed.rows)
    np.testing.assert_allclose(moving["linear"], (0, 5, 0), atol=1e-12)
    np.testing.assert_allclose(moving["acceleration"], (0, 2, 0), atol=1e-12)
    assert moving["flags"] == StateFlag.ACCELERATION_VALID | StateFlag.STOPS | StateFlag.BODY_TWIST
    assert still["linear"].tolist() == [0, 0, 0]
    assert fed.covariances[0][[0, 3, 5]] == pytest.approx([0.01, 0.04, 0.09])  # the pose's are along the map's axes
    assert fed.covariances[0][[6, 9, 11]] == pytest.approx([0.04, 0.01, 0.09])
    assert not fed.covariances[1].any()
    predicted = Fed({"traffic": {"topic": "/t"}})
    predicted.give(
        "/t", START, predicted_objects("map", START, track(1, (1, 2, 3), q.as_quat(), (5, 0, 0), predicted=True))
    )
    np.testing.assert_allclose(in_world(predicted.rows)[0]["linear"], (0, 5, 0), atol=1e-12)


def test_shapes_of_tracks_hold_what_was_measured_and_change_seldom() -> None:
    rng = np.random.default_rng(1)
    fed = Fed({"traffic": {"topic": "/t", "shape_tolerance": 0.1}})
    for k in range(100):
        size = np.array([4.0, 2.0, 1.5]) + rng.uniform(-0.04, 0.04, 3)
        fed.give("/t", at(k), tracked_objects("map", at(k), track(1, (k, 0, 0), size=size)))
        described = fed.changes[-1].shapes[0][0].size  # type: ignore[union-attr]
        assert (described >= size).all() and (described <= size + 0.2).all()
    assert len(fed.changes) <= 4
    corners = [(2, 0), (0, 1), (-2, 0), (0, -1), (0.2, 0)]  # concave
    fed.give(
        "/t",
        at(100),
        tracked_objects("map", at(100), track(2, (0, 0, 0), kind=POLYGON, footprint=[(*c, 0) for c in corners])),
    )
    assert len(fed.changes[-1].shapes) > 1  # type: ignore[union-attr]
    assert fed.changes[-1].padding == pytest.approx(0.1)  # type: ignore[union-attr]
    fed.give("/t", at(101), tracked_objects("map", at(101), track(3, (0, 0, 0), (0, 0, 0, 0), orientation=0)))
    assert fed.changes[-1].shapes[0][0].radius >= math.hypot(4, 2) / 2  # type: ignore[union-attr]
    assert fed.rows["quaternion"][-1].tolist() == [0, 0, 0, 1]


def test_wrong_tracks_are_refused_and_the_others_go_on() -> None:
    fed = Fed({"traffic": {"topic": "/t", "min_existence": 0.5}})
    flat = track(3, (0, 0, 0), size=(1, -2, 1))
    nan = track(4, (0, 0, 0), size=(np.nan, 2, 1))
    odd = track(5, (0, 0, 0), kind=9)
    wild = track(6, (0, 0, 0), pose_covariance=np.diag([-5.0, 1, 1, 1, 1, 1]))
    unlikely = track(7, (0, 0, 0), existence=0.1)
    objects = [track(1, (0, 0, 0)), track(1, (1, 0, 0)), flat, nan, odd, wild, unlikely]
    fed.give("/t", START, tracked_objects("map", START, *objects))
    assert len(fed.rows) == 2
    texts = " / ".join(fed.refused)
    for part in (
        "expected it once in a message, got it twice",
        "traffic_car_2: Box",
        "shape.type: expected 0 (box), 1 (cylinder) or 2 (polygon), got 9",
        "covariance: expected symmetric",
    ):
        assert part in texts


def test_tracks_without_a_transform_become_stale_and_do_not_vanish() -> None:
    fed = Fed({"traffic": {"topic": "/t", "forget_after": 0.1}})
    fed.give("/tf", START, transforms(START, ("map", "base", (0, 0, 0), (0, 0, 0, 1))))
    for k in range(40):
        fed.give("/t", at(k), tracked_objects("base", at(k), track(1, (k, 0, 0))))
    assert fed.names == ["traffic_car_1"]
    assert len(fed.steps) == 21  # up to max_age, 1 s
    text = "traffic: the transform from 'map' to 'base' is older than the message by more than max_age, 1 s"
    assert fed.refused == {text: 19}


# -- detections


def test_speeds_of_detections_are_estimated_within_their_stated_uncertainty() -> None:
    rng = np.random.default_rng(2)
    sigma, errors, stated = 0.05, [], []
    for _ in range(30):
        fed = Fed({"people": {"topic": "/d", "estimate_over": 0.5}})
        for k in range(12):
            p = np.array([1.5 * k * 0.05, 0, 0]) + rng.normal(0, sigma, 3)
            fed.give("/d", at(k), detections("map", at(k), detection(p, name="7", variance=sigma**2)))
        row = fed.rows[-1]
        assert row["flags"] == 0
        errors.append(row["linear"] - (1.5, 0, 0))
        stated.append(row["velocity_stddev"])
    assert fed.names == ["people_person_7"]
    assert np.std(errors) == pytest.approx(np.mean(stated), rel=0.25)
    assert np.mean(stated) == pytest.approx(sigma / math.sqrt(sum((0.05 * k - 0.25) ** 2 for k in range(11))), rel=1e-6)


def test_detections_without_ids_continue_the_nearest_track_of_their_class() -> None:
    fed = Fed({"people": {"topic": "/d", "gate": 0.6}})
    for k in range(10):
        left, right = detection((0.1 * k, 0, 0)), detection((1 - 0.1 * k, 0.5, 0))
        dog = detection((0.1 * k, 0.01, 0), label="dog")
        order = [left, right, dog] if k % 2 else [dog, right, left]
        fed.give("/d", at(k), detections("map", at(k), *order))
    assert sorted(fed.names) == ["people_dog_1", "people_person_2", "people_person_3"]
    rows = fed.rows[fed.rows["id"] == fed.changes[1].object_id]
    np.testing.assert_allclose(rows["position"][:, 1], 0.5)
    fed.give("/d", at(10), detections("map", at(10), detection((0, 0, 0), name="a"), detection((0, 0, 0), name="a")))
    assert "id 'a': expected it once in a message, got it twice" in next(iter(fed.refused))


# -- footprints, markers, scans


def test_a_footprint_that_drives_and_turns_is_one_object_with_its_motion() -> None:
    corners = np.array([(0.5, 0.3), (-0.5, 0.3), (-0.5, -0.3), (0.5, -0.3), (0.7, 0.0)])
    fed = Fed({"robot": {"topic": "/f", "height": 0.6}}, rate=20)
    for k in range(6):
        angle = 0.5 * k * 0.05
        R = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        fed.give("/f", at(k), footprint("map", at(k), corners @ R.T + (1.0 * k * 0.05, 0)))
    assert fed.names == ["robot"]
    assert fed.changes[0].padding == pytest.approx(0.05)  # type: ignore[union-attr]
    row = fed.rows[-1]
    np.testing.assert_allclose(row["angular"], (0, 0, 0.5), atol=1e-5)  # the corners are float32
    centre = corners.mean(0)
    speed = np.array([1.0, 0.0]) + 0.5 * np.array([-centre[1], centre[0]])
    np.testing.assert_allclose(row["linear"][:2], speed, atol=0.02)
    fed.give("/f", at(6), footprint("map", at(6), corners * 2))
    assert len(fed.changes) == 2
    fed.give("/f", at(7), footprint("map", at(7), corners[:2]))
    fed.give("/f", at(8), footprint("map", at(8), [(0, 0), (1, 1), (1, 0), (0, 1)]))
    assert any("at least 3 finite corners" in text for text in fed.refused)
    assert any("edges from corners" in text for text in fed.refused)


def test_markers_expire_by_their_lifetime_and_by_forget_after() -> None:
    fed = Fed({
        "short": {"topic": "/m", "marker": {"ns": "short"}},
        "crates": {"topic": "/m", "marker": {"ns": "crates"}, "forget_after": 0.3},
        "kept": {"topic": "/m", "marker": {"ns": "kept"}},
    })  # fmt: skip
    each = [marker(name, 1, 1, (1, 1, 1), (0, 0, 0), frame="map", stamp=START) for name in ("short", "crates", "kept")]
    each[0].lifetime = T["builtin_interfaces/msg/Duration"](0, 120_000_000)
    fed.give("/m", START, markers(*each))
    ids = {change.name: change.object_id for change in fed.changes}  # type: ignore[union-attr]
    for k in range(1, 12):
        fed.give("/m", at(k), markers(marker("other", 1, 1, (1, 1, 1), (0, 0, 0), frame="map", stamp=at(k))))
    assert fed.names[3:] == [f"-{ids['short_1']}", f"-{ids['crates_1']}"]


def test_points_of_scans() -> None:
    _, scan = laser_scan("laser", START, [1, np.inf, np.nan, 20, 0.01, 2], start=0.0, step=math.pi / 2)
    beams = read_beams(scan)
    np.testing.assert_allclose(beams.points[beams.met], [[1, 0, 0], [0, 2, 0]], atol=1e-6)
    assert beams.failed.tolist() == [False, False, True, False, True, False]
    rng = np.random.default_rng(3)
    points = rng.normal(size=(500, 3)).astype(np.float32).astype(np.float64)
    points[7] = np.nan
    _, cloud = point_cloud("lidar", START, points, gap=20)
    found, lost = read_cloud_points(cloud)
    np.testing.assert_array_equal(found, np.delete(points, 7, 0))
    assert lost == 1
    cloud.is_bigendian = True
    assert not np.array_equal(read_cloud_points(cloud)[0], np.delete(points, 7, 0))
    cloud.is_bigendian, cloud.width = False, 501
    with pytest.raises(InputError, match="data: expected 1 rows of"):
        read_cloud_points(cloud)
    cloud.width = 1 << 31
    with pytest.raises(InputError, match="expected at most 2000000 points"):
        read_cloud_points(cloud)
    cloud.width, cloud.fields = 500, cloud.fields[:2]
    with pytest.raises(InputError, match=r"fields: expected x, y and z of FLOAT32 \(7\)"):
        read_cloud_points(cloud)


def test_a_scan_is_one_object_without_the_points_on_the_robot_that_carries_the_sensor() -> None:
    robot = {"topic": "/odom", "shape": {"box": [1, 1, 1]}}
    scan = {"topic": "/scan", "without": ["robot"], "clearance": 0.1, "radius": 0.02}
    fed = Fed({"robot": robot, "scan": scan})
    ahead = [(0.55, 0, 0), (2, 0, 0), (np.nan, 0, 0), (0.7, 0, 0)]  # the first one is on the robot, with the clearance
    fed.give("/scan", at(0), point_cloud("map", at(0), np.add(ahead, (3, 0, 0))))
    assert any("the pose of robot is not known" in text for text in fed.refused)
    fed.give("/odom", at(1), odometry("map", at(1), (3 - 0.05, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0)))
    fed.give("/scan", at(2), point_cloud("map", at(2), np.add(ahead, (3, 0, 0))))  # 0.05 s and 0.05 m later
    ((cloud, _),) = fed.changes[-1].shapes  # type: ignore[union-attr]
    np.testing.assert_allclose(cloud.points[:, 0], [5, 3.7], atol=1e-6)
    assert cloud.radius == 0.02 and fed.feed.scene.points_dropped["scan"] == 2
    fed.give("/scan", at(3), point_cloud("map", at(3), [(3.1, 0, 0)]))
    assert fed.names[-1].startswith("-")  # nothing is left
    fed = Fed({"robot": robot, "scan": {**scan, "without": ["robto"]}})
    (problem,) = fed.feed.bind("/scan", laser_scan("map", START, [1])[0]).values()
    assert "scan, without: 'robto' is unknown: did you mean 'robot'" in problem
    fed = Fed({"scan": {"topic": "/scan"}})
    fed.give("/scan", at(0), laser_scan("map", at(0), [1, np.inf, np.nan, 2]))
    ((cloud, _),) = fed.changes[-1].shapes  # type: ignore[union-attr]
    assert len(cloud.points) == 2 and fed.feed.scene.points_dropped["scan"] == 1


@given(st.integers(0, 1000), st.floats(0.01, 2.0))
def test_thinned_clouds_hold_all_balls(seed: int, voxel: float) -> None:
    points = np.random.default_rng(seed).normal(size=(80, 3)) * 3
    centres, radius = thinned(points, voxel, 0.1)
    distance = np.linalg.norm(points[:, None] - centres, axis=2).min(1)
    assert (distance + 0.1 <= radius + 1e-9).all()
    assert len(centres) <= len(points)


def test_the_feed_finds_static_objects_in_frames() -> None:
    fed = Fed({"shelf": {"static": True, "frame": "hall", "shape": SPHERE, "pose": [1, 0, 0]}})
    assert fed.names == []
    assert "expected static transforms from 'map' to 'hall'" in fed.feed.misplaced[0]
    fed.give("/tf_static", START, transforms(START, ("map", "hall", (0, 5, 0), (0, 0, 1, 0))))
    assert fed.names == ["shelf"]
    assert fed.changes[0].pose.position.tolist() == [-1, 5, 0]  # type: ignore[union-attr]
    assert isinstance(fed.feed.scene.frames.motion("map", "hall", 0), FrameMotion)
