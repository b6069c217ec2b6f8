"""Tracks read from their bytes equal those that rosbags decodes by the definition, for random content."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from foreign_bag import START, STORE, T, pose
from foreign_messages import AUTOWARE, POLYGON, predicted_objects, track, tracked_objects
from hypothesis import given
from hypothesis import strategies as st

from collision_monitor.errors import MessageError
from collision_monitor.sources.messages.autoware_bytes import HASHES, read_tracks


def random_message(seed: int, predicted: bool) -> tuple[str, Any]:
    rng = np.random.default_rng(seed)
    objects = []
    for number in range(rng.integers(0, 6)):
        corners = rng.normal(size=(rng.integers(0, 7), 3))
        each = track(
            int(rng.integers(0, 1 << 60)) + number, rng.normal(size=3), rng.normal(size=4), rng.normal(size=3),
            rng.normal(size=3), kind=POLYGON if len(corners) else int(rng.integers(0, 2)), footprint=corners,
            size=rng.normal(size=3), existence=float(rng.random()), pose_covariance=rng.normal(size=36),
            twist_covariance=rng.normal(size=36), orientation=int(rng.integers(0, 3)),
            stationary=bool(rng.integers(0, 2)), acceleration=rng.normal(size=3), predicted=predicted,
        )  # fmt: skip
        classes = [T[AUTOWARE + "ObjectClassification"](int(k), float(rng.random())) for k in range(rng.integers(0, 4))]
        each.classification = classes
        if predicted:
            duration = T["builtin_interfaces/msg/Duration"](0, 5)
            each.kinematics.predicted_paths = [
                T[AUTOWARE + "PredictedPath"](
                    [pose(rng.normal(size=3)) for _ in range(rng.integers(0, 3))], duration, 0.5
                )
                for _ in range(rng.integers(0, 3))
            ]
        objects.append(each)
    frame = "map"[: rng.integers(0, 4)]
    return (predicted_objects if predicted else tracked_objects)(frame, START + int(rng.integers(0, 10**9)), *objects)


@given(st.integers(0, 100_000), st.booleans())
def test_the_arrays_are_those_of_the_definition(seed: int, predicted: bool) -> None:
    kind, message = random_message(seed, predicted)
    read = read_tracks(bytes(STORE.serialize_cdr(message, kind)), predicted)
    assert (read.header.frame_id, read.header.stamp.nanosec) == (message.header.frame_id, message.header.stamp.nanosec)
    assert len(read.uuids) == len(message.objects)
    for k, each in enumerate(message.objects):
        kinematics = each.kinematics
        prefix = "initial_pose" if predicted else "pose"
        where = getattr(kinematics, f"{prefix}_with_covariance")
        p, q = where.pose.position, where.pose.orientation
        assert read.uuids[k] == each.object_id.uuid.tobytes()
        assert read.existence[k] == np.float32(each.existence_probability)
        likeliest = max(each.classification, key=lambda it: np.float32(it.probability), default=None)
        assert read.labels[k] == (likeliest.label if likeliest else 0)
        assert read.pose[k].tolist() == [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
        assert read.pose_covariance[k].tolist() == where.covariance.tolist()
        twist = kinematics.initial_twist_with_covariance if predicted else kinematics.twist_with_covariance
        assert read.twist[k][5] == twist.twist.angular.z
        assert read.twist_covariance[k].tolist() == twist.covariance.tolist()
        accel = (
            kinematics.initial_acceleration_with_covariance if predicted else kinematics.acceleration_with_covariance
        )
        assert read.acceleration[k][1] == accel.accel.linear.y
        if not predicted:
            assert read.orientation[k] == kinematics.orientation_availability
            assert read.stationary[k] == kinematics.is_stationary
        assert read.kind[k] == each.shape.type
        assert read.size[k].tolist() == [each.shape.dimensions.x, each.shape.dimensions.y, each.shape.dimensions.z]
        if each.shape.footprint.points:
            assert len(read.footprints[k]) == len(each.shape.footprint.points)
            assert read.footprints[k][-1, 1] == np.float32(each.shape.footprint.points[-1].y)


@pytest.mark.parametrize("predicted", [False, True])
def test_bytes_that_end_early_or_lie_are_refused(predicted: bool) -> None:
    kind, message = next(m for m in (random_message(k, predicted) for k in range(50)) if len(m[1].objects) > 2)
    data = bytes(STORE.serialize_cdr(message, kind))
    for size in range(0, len(data) - 8, 7):
        with pytest.raises(MessageError):
            read_tracks(data[:size], predicted)
    rng = np.random.default_rng(1)
    for _ in range(300):
        damaged = bytearray(data)
        for at in rng.integers(0, len(data), 4):
            damaged[at] = rng.integers(0, 256)
        try:
            read_tracks(bytes(damaged), predicted)
        except MessageError:
            continue


def test_the_definitions_have_the_layout_that_is_read() -> None:
    for name, type_hash in HASHES.items():
        assert STORE.hash_rihs01(name) == type_hash
