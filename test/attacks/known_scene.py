"""A scene with answers that are known in closed form. They have to stay right between the attacks."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from collision_monitor.codec import (
    ContactArray,
    ObjectDescriptionArray,
    PredictedCollisionArray,
    encode_descriptions,
    encode_states,
)
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.records import STATE, Phase, PredictionStatus, StateFlag
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Sphere

BALL, WALL, LEFT, RIGHT, NORTH, SOUTH = range(1, 7)
IDS: Final = frozenset((BALL, WALL, LEFT, RIGHT, NORTH, SOUTH))

RADIUS: Final = 0.5
"""m: radius of the ball."""
FRONT: Final = 3.9
"""m: x of the wall's side that the ball approaches."""
DEPTH: Final = 0.1
"""m: overlap of the two cubes."""

SPEED: Final = 1.0
"""m/s: speed of the ball."""
MOVED: Final = 10.0
"""m: from one place of the scene to another."""

TIME_TOLERANCE: Final = 2e-3
"""s: the gap at which an impact counts as settled (impact_tolerance) and the tolerances of the motion, by the speed."""
DISTANCE_TOLERANCE: Final = 1e-9
"""m."""

Y: Final = -40.0
"""m: the scene stands aside of the attackers' objects, which may still reach it and must not change its answers."""


def objects() -> list[ObjectDescription]:
    """Return a ball and a wall, two cubes that overlap, and two balls that never meet."""
    return [
        ObjectDescription(BALL, Sphere(RADIUS), name="ball"),
        ObjectDescription(WALL, Box((0.2, 40, 8)), name="wall", static=True, pose=Pose((FRONT + 0.1, Y, 0))),
        ObjectDescription(LEFT, Box((1, 1, 1)), name="left"),
        ObjectDescription(RIGHT, Box((1, 1, 1)), name="right"),
        ObjectDescription(NORTH, Sphere(RADIUS), name="north"),
        ObjectDescription(SOUTH, Sphere(RADIUS), name="south"),
    ]


def descriptions(stamp_ns: int, *, snapshot: bool) -> bytes:
    """Return the ObjectDescriptionArray of the scene."""
    return encode_descriptions(stamp_ns, "world", objects(), snapshot=snapshot)


def changes_the_scene(message: ObjectDescriptionArray) -> bool:
    """Whether a valid message describes or removes an object of the scene, which its sender may do."""
    return message.snapshot or any(change.object_id in IDS for change in message.objects)


def ball_x(step: int) -> float:
    """Return the ball's x (m) in a step: it approaches the wall by SPEED for two seconds and begins anew."""
    return FRONT - RADIUS - 0.1 - SPEED * 0.01 * (180 - step % 180)


def time_of_impact(step: int) -> float:
    """Return when the ball meets the wall, in s after the step."""
    return (FRONT - RADIUS - ball_x(step)) / SPEED


def states(step: int, place: int, stamp_ns: int) -> bytes:
    """Return the ObjectStateArray of a step. Every state says where its object is, wherever it was before.

    place: another one moves the scene along the wall, by more than the bounds of an object that was silent for a while.
    """
    rows = np.zeros(5, STATE)
    rows["id"] = BALL, LEFT, RIGHT, NORTH, SOUTH
    rows["quaternion"][:, 3] = 1.0
    rows["flags"] = StateFlag.DISCONTINUITY
    y = Y + MOVED * (place % 2)
    cubes = (-20, y, 0), (-20 + 1 - DEPTH, y + 0.2, 0)
    rows["position"] = [(ball_x(step), y, 0), *cubes, (-60, y + 2, 0), (-60, y - 2, 0)]
    rows["linear"][:, 0] = SPEED, 0, 0, 1, -1
    return encode_states(stamp_ns, "world", 0, rows)


def wrong(step: int, contacts: ContactArray, predictions: PredictedCollisionArray) -> list[str]:
    """Return what is wrong with the answers to a step about the pairs of the scene, one sentence each."""
    found = []
    touching = _pairs(contacts.contacts[contacts.contacts["phase"] != Phase.END])
    predicted = _pairs(predictions.predictions)
    contact = touching.pop((LEFT, RIGHT), None)
    if contact is None:
        found.append("the two cubes overlap and are not reported")
    elif not abs(contact["signed_distance"] + DEPTH) <= DISTANCE_TOLERANCE + contact["error_bound"] <= 1e-3:
        got = f"{contact['signed_distance']} +- {contact['error_bound']}"
        found.append(f"the two cubes: expected -{DEPTH} m, got {got} m")
    impact, truth = predicted.pop((BALL, WALL), None), time_of_impact(step)
    if impact is None:
        if truth < predictions.horizon - TIME_TOLERANCE:
            found.append(f"the ball meets the wall in {truth:.4f} s and is not reported")
    elif not impact["lower"] - TIME_TOLERANCE <= truth <= impact["upper"] + TIME_TOLERANCE:
        found.append(f"the ball: expected {truth} s, got {impact['lower']} to {impact['upper']} s")
    elif impact["status"] != PredictionStatus.HIT or impact["stale"]:
        found.append(f"the ball: expected a certain collision, got status {impact['status']}, stale {impact['stale']}")
    found += [f"{pair} do not touch and are reported as a contact" for pair in touching]
    found += [f"{pair} never meet and are reported as a prediction" for pair in predicted]
    return found


def _pairs(rows: Any) -> dict[tuple[int, int], Any]:
    """Return the rows of the pairs of the scene alone."""
    both = (rows["id_a"] >= BALL) & (rows["id_b"] <= SOUTH)  # id_a < id_b
    return {(int(row["id_a"]), int(row["id_b"])): row for row in rows[both]}
