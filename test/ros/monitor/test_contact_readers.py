"""The details of contacts are computed while something reads them, and the first message of a reader has them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from collision_monitor import codec, records
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.pipeline.topics import Topic
from collision_monitor.ros.endpoints import quality_of
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.registry import Box
from collision_monitor_msgs.msg import ContactArray

BOXES = [ObjectDescription(i, Box((1, 1, 1))) for i in (1, 2)]


def overlapping() -> np.ndarray:
    states = np.zeros(2, records.STATE)
    states["id"], states["quaternion"][:, 3], states["position"][:, 0] = (1, 2), 1.0, (0.0, 0.75)
    return states


def answered_without_details(stamps: list[int]) -> int:
    """Digest of the answers of a pipeline without details."""
    pipeline = Pipeline(Profile(contact_details=False))
    pipeline.on_shapes(codec.encode_descriptions(0, "world", BOXES))
    for stamp in stamps:
        assert pipeline.on_states(codec.encode_states(stamp, "world", 0, overlapping())) is not None
    return pipeline.monitor.digest


def test_details_are_computed_while_something_reads_them(start, team):
    start("run")
    team.meet()
    team.stop_reading_contacts()
    team.describe(*BOXES)
    team.status(lambda s: s.objects == 2)
    stamps = []
    for step in (1, 2):
        stamps.append(team.say(*overlapping()))
        status = team.status(lambda s, step=step: s.step == step)
    assert status.contacts == 1
    assert status.digest == answered_without_details(stamps)

    read: list[ContactArray] = []
    team.node.create_subscription(ContactArray, "/object_monitor/contacts", read.append, quality_of(Topic.CONTACTS))
    timer = team.node.create_timer(0.02, lambda: team.say(*overlapping()))
    team.until(lambda: len(read) > 3)
    team.node.destroy_timer(timer)
    for message in read:
        (contact,) = message.contacts
        assert contact.point_a.x == pytest.approx(0.5)
        assert not math.isnan(contact.closing_speed)
        assert contact.feature_type_a == contact.FEATURE_FACE
