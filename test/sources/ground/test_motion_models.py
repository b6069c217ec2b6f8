"""How objects move on from their states, by source, entry and class."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fed import Fed
from foreign_bag import SECOND, START, odometry, pose_stamped, transforms
from foreign_messages import detection, detections, track, tracked_objects

from collision_monitor.errors import InputError
from collision_monitor.records import StateFlag
from collision_monitor.sources.ground.motion_models import GRAVITY, MANOEUVRE, damped_part

TURNS, STOPS, VALID = StateFlag.BODY_TWIST, StateFlag.STOPS, StateFlag.ACCELERATION_VALID
BRAKED = STOPS | VALID
CAR, PEDESTRIAN, HAZARD = 1, 7, 9


def traffic(label: int, **entry: Any) -> Any:
    """The state of a track that brakes and turns."""
    given = Fed({"traffic": {"topic": "/t", **entry}})
    one = track(1, (0, 0, 0), linear=(5, 0, 0), angular=(0, 0, 0.2), acceleration=(-2, 0, 0), label=label)
    given.give("/t", START, tracked_objects("map", START, one))
    assert not given.refused
    return given.rows[0]


@pytest.mark.parametrize(
    ("label", "entry", "flags", "acceleration"),
    [
        (CAR, {}, TURNS | BRAKED, -2),
        (PEDESTRIAN, {}, 0, 0),
        (HAZARD, {}, 0, 0),
        (CAR, {"motion": "stops"}, BRAKED, -2),
        (CAR, {"motion": "straight"}, VALID, -2),
        (CAR, {"motion": "people"}, 0, 0),
        (CAR, {"motion": {"pedestrian": "arc"}}, TURNS | BRAKED, -2),
        (PEDESTRIAN, {"motion": {"pedestrian": "arc"}}, TURNS | BRAKED, -2),
        (CAR, {"motion": {"others": "stops", "pedestrian": "arc"}}, BRAKED, -2),
        (CAR, {"acceleration": "off"}, TURNS, 0),
        (CAR, {"acceleration": False}, TURNS, 0),
        (CAR, {"acceleration": "damped"}, TURNS | BRAKED, -2 * damped_part(2.0)),
    ],
)
def test_a_track_moves_by_the_model_of_its_class(label: int, entry: Any, flags: int, acceleration: float) -> None:
    row = traffic(label, **entry)
    assert row["flags"] == flags
    assert row["acceleration"].tolist() == pytest.approx([acceleration, 0, 0])
    assert row["linear"].tolist() == [5, 0, 0]


def test_odometry_and_frames_of_tf_are_on_arcs_and_other_poses_go_straight() -> None:
    shape = {"shape": {"sphere": 1}}
    given = Fed(
        {
            "robot": {"topic": "/odom", **shape},
            "frame": {"topic": "/tf", "frame": "cart", **shape},
            "person": {"topic": "/tf", "frame": "walker", "motion": "people", **shape},
            "pose": {"topic": "/pose", **shape},
        },
        rate=10,
    )
    for k in range(4):
        t = START + k * SECOND // 10
        half = 0.05 * k
        q = (0, 0, np.sin(half), np.cos(half))
        links = [("map", name, (k * 0.1, y, 0), q) for name, y in (("cart", 5), ("walker", 9))]
        given.give("/odom", t, odometry("map", t, (0, 0, 0), q, (1, 0, 0), (0, 0, 1)))
        given.give("/tf", t, transforms(t, *links))
        given.give("/pose", t, pose_stamped("map", t, (k * 0.1, 20, 0), q))
    last = given.steps[-1].states
    assert [bool(flags & TURNS) for flags in last["flags"]] == [True, True, False, False]


def test_what_falls_gets_the_acceleration_of_gravity_and_goes_down() -> None:
    given = Fed({"ball": {"topic": "/pose", "motion": "free_fall", "shape": {"sphere": 0.1}}}, rate=20)
    for k in range(8):
        t = START + k * SECOND // 20
        given.give("/pose", t, pose_stamped("map", t, (k * 0.05, 0, 5 - GRAVITY / 2 * (k / 20) ** 2)))
    row = given.rows[-1]
    assert row["flags"] == VALID and row["acceleration"].tolist() == [0, 0, -GRAVITY]
    assert row["linear"][2] == pytest.approx(-GRAVITY * 6.5 / 20)  # the slope between the last two poses


def test_classes_of_detections_have_models() -> None:
    given = Fed({"all": {"topic": "/d", "motion": {"fork_lift": "arc"}}})
    for k in range(3):
        t = START + k * SECOND // 10
        seen = [detection((k * 0.1, y, 0), name=str(y), label=label) for y, label in ((0, "person"), (5, "fork_lift"))]
        given.give("/d", t, detections("map", t, *seen))
    assert [bool(flags & TURNS) for flags in given.steps[-1].states["flags"]] == [False, True]


@pytest.mark.parametrize("horizon", [0.5, 2.0, 5.0])
def test_a_damped_acceleration_leads_as_far_as_one_that_decays(horizon: float) -> None:
    times = np.linspace(0, horizon, 20_001)
    velocity = np.append(0, np.cumsum((np.exp(-times[1:] / MANOEUVRE) + np.exp(-times[:-1] / MANOEUVRE)) / 2)) * (
        times[1]
    )
    way = ((velocity[1:] + velocity[:-1]) / 2).sum() * times[1]
    assert damped_part(horizon) * horizon**2 / 2 == pytest.approx(way, rel=1e-6)


def test_without_a_horizon_nothing_is_damped() -> None:
    assert damped_part(0.0) == 1.0
    assert damped_part(1.01e-4) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(
    ("topic", "entry", "text"),
    [
        ("/t", {"motion": "arcs"}, "a, motion: 'arcs' is unknown"),
        ("/t", {"motion": {"car": "fast"}}, "a, motion: 'fast' is unknown"),
        ("/t", {"motion": {"lorry": "arc"}}, "a, motion: 'lorry' is unknown"),
        ("/t", {"acceleration": "soft"}, "a, acceleration: 'soft' is unknown"),
        ("/t", {"motion": {str(k): "arc" for k in range(101)}}, "a, motion: expected a model, or at most 100 classes"),
    ],
)
def test_what_is_no_model_is_refused(topic: str, entry: Any, text: str) -> None:
    problems = {}
    try:
        given = Fed({"a": {"topic": topic, **entry}})
        problems = given.feed.bind(topic, "autoware_perception_msgs/msg/TrackedObjects")
    except InputError as error:
        problems["a"] = str(error)
    assert text in problems["a"]
