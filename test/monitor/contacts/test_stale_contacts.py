"""A contact with a stale object is settled only if its widened bound leaves no doubt."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import collision_monitor as cm
from collision_monitor.records import ContactStatus

OTHER, SECOND = 3, 1_000_000_000
PAIRS = {
    "balls": (cm.Sphere(0.5), cm.Sphere(0.5)),
    "boxes": (cm.Box((1, 1, 1)), cm.Box((1, 1, 1))),
    "capsule and box": (cm.Capsule(0.5, 1.0), cm.Box((1, 1, 1))),
    "a mesh and a ball": (cm.Mesh(*[np.asarray(a) for a in ([(-0.5, -0.5, -0.5), (0.5, -0.5, -0.5), (0, 0.5, -0.5),
                          (0, 0, 0.5)], [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)])]), cm.Sphere(0.5)),
}  # fmt: skip


def status_after(shapes: tuple[Any, Any], overlap: float, silence: float, **settings: Any) -> tuple[int, float, float]:
    """The contact of two objects at rest after a silence of both (s): status, signed distance, bound."""
    monitor = cm.Monitor(cm.Profile.named("balanced").replace(stale_acceleration=1.0, stale_after=0.5, **settings))
    for k, shape in enumerate(shapes):
        monitor.add(k, shape, name=str(k))
    monitor.add(OTHER, cm.Sphere(0.1), name="other")
    apart = cm.contact(shapes[0], cm.Pose(), shapes[1], cm.Pose((0, 0, 5))).signed_distance
    poses = [(0, 0, 0, 0, 0, 0, 1), (0, 0, 5 - apart - overlap, 0, 0, 0, 1), (50, 0, 0, 0, 0, 0, 1)]
    monitor.step(0, [0, 1, OTHER], poses, np.zeros((3, 6)))
    result = monitor.step(round(silence * SECOND), [OTHER], poses[2:], np.zeros((1, 6)))
    (contact,) = result.contacts
    return int(contact["status"]), float(contact["signed_distance"]), float(contact["error_bound"])


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("settings", [{}, {"distance_tolerance": 0.01}, {"contact_details": False}])
def test_a_stale_contact_is_settled_only_without_doubt(pair: str, settings: dict[str, Any]) -> None:
    shapes = PAIRS[pair]
    assert status_after(shapes, 0.05, 0.3, **settings)[0] == ContactStatus.TOUCHING  # not stale yet
    status, distance, bound = status_after(shapes, 0.05, 0.6, **settings)
    assert bound >= 2 * 0.5 * 0.6**2 > -distance
    assert status == ContactStatus.UNRESOLVED
    status, distance, _ = status_after(shapes, 0.45, 0.6, **settings)
    assert distance < -2 * 0.5 * 0.6**2
    assert status == ContactStatus.TOUCHING  # they overlap whatever they did since


def test_an_alert_of_a_doubtful_contact_says_so() -> None:
    from collision_monitor.alerts.answered import answered
    from collision_monitor.alerts.monitored_bodies import MonitoredBodies

    monitor = cm.Monitor()
    for k in range(2):
        monitor.add(k, cm.Sphere(0.5), name=str(k))
    monitor.add(OTHER, cm.Sphere(0.1), name="other")
    poses = [(0, 0, 0, 0, 0, 0, 1), (0, 0, 0.95, 0, 0, 0, 1), (50, 0, 0, 0, 0, 0, 1)]
    monitor.step(0, [0, 1, OTHER], poses, np.zeros((3, 6)))
    result = monitor.step(SECOND, [OTHER], poses[2:], np.zeros((1, 6)))
    found = answered(MonitoredBodies(monitor.roster, monitor.profile, monitor.now), result)
    assert found["time_to_collision"][0] == 0.0
    assert np.isinf(found["time_to_collision_upper"][0])
    assert found.uncertain[0]
