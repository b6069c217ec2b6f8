"""The quality of service in a session is the one that the node offers."""

from __future__ import annotations

import pytest

endpoints = pytest.importorskip("collision_monitor.ros.endpoints")

from rclpy.qos import qos_profile_parameter_events  # noqa: E402

from collision_monitor.pipeline.topics import Topic  # noqa: E402
from collision_monitor.session.mcap.rosbag2 import RECORDED_TYPES, qos_profiles  # noqa: E402

NODE = {
    "ObjectStateArray": endpoints.quality_of(Topic.STATES),
    "ObjectDescriptionArray": endpoints.quality_of(Topic.SHAPES),
    "ContactArray": endpoints.quality_of(Topic.CONTACTS),
    "PredictedCollisionArray": endpoints.quality_of(Topic.PREDICTIONS),
    "CollisionAlert": endpoints.quality_of(Topic.ALERTS),
    "MonitorStatus": endpoints.quality_of(Topic.STATUS),
    "ObjectTrajectoryArray": endpoints.quality_of(Topic.TRAJECTORIES),
    "DiagnosticArray": endpoints.quality_of(Topic.SOURCES),
    "ParameterEvent": qos_profile_parameter_events,
}


@pytest.mark.parametrize("name", RECORDED_TYPES)
def test_the_recorded_profile_is_the_nodes(name: str) -> None:
    (recorded,) = qos_profiles(name)
    profile = NODE[name]
    assert recorded["depth"] == profile.depth
    assert recorded["history"] == profile.history.name.lower()
    assert recorded["reliability"] == profile.reliability.name.lower()
    assert recorded["durability"] in (profile.durability.name.lower(), "volatile")
    assert (recorded["durability"] == "transient_local") == (profile.durability.name == "TRANSIENT_LOCAL")
