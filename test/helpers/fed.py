"""A feed with decoded inputs, for tests of sources without a bag."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from foreign_bag import STORE
from foreign_messages import decoder

from collision_monitor.codec import (
    Change,
    ObjectStateArray,
    ObjectTrajectoryArray,
    decode_descriptions,
    decode_states,
    decode_trajectories,
)
from collision_monitor.pipeline.topics import Topic
from collision_monitor.records import StateFlag
from collision_monitor.shapes.pose import rotation_matrix
from collision_monitor.sources import Feed, Input, RawMessage
from collision_monitor.sources.ground.mapping import make_mapping


def in_world(rows: Any) -> Any:
    """States (N,) with twists along the world's axes, where they are along the bodies' own."""
    turned, own = rows.copy(), (rows["flags"] & StateFlag.BODY_TWIST) != 0
    R = rotation_matrix(rows["quaternion"][own])
    for name in ("linear", "angular", "acceleration"):
        turned[name][own] = (R @ rows[name][own][..., None])[..., 0]
    return turned


class Fed:
    """Feeds messages (topic, received, (type, message)). steps: the state arrays; changes: the descriptions; plans."""

    def __init__(
        self, objects: dict[str, Any] | None = None, *, begin: int = 0, allowance: int | None = None, **top: Any
    ) -> None:
        content = {"frame": "map", **top, **({} if objects is None else {"objects": objects})}
        self.feed = Feed(make_mapping(content), decoder(), allowance=allowance)
        self.steps: list[ObjectStateArray] = []
        self.changes: list[Change] = []
        self.plans: list[ObjectTrajectoryArray] = []
        self._bound: set[str] = set()
        self._keep(self.feed.begin(begin))

    def give(self, topic: str, received: int, message: tuple[str, Any]) -> None:
        kind, content = message
        if topic not in self._bound and topic in self.feed.mapping.topics:
            self._bound.add(topic)
            self.feed.bind(topic, kind)
        data = content if isinstance(content, bytes) else bytes(STORE.serialize_cdr(content, kind))
        self._keep(self.feed.take(RawMessage(topic, kind, data, received)))

    def give_all(self, messages: Iterable[tuple[str, int, tuple[str, Any]]]) -> None:
        for message in messages:
            self.give(*message)

    def _keep(self, inputs: list[Input]) -> None:
        for each in inputs:
            if each.topic is Topic.STATES:
                self.steps.append(decode_states(each.data))
            elif each.topic is Topic.TRAJECTORIES:
                self.plans.append(decode_trajectories(each.data))
            else:
                message = decode_descriptions(each.data)
                assert not message.refused
                self.changes += message.objects

    @property
    def rows(self) -> Any:
        return np.concatenate([step.states for step in self.steps])

    @property
    def covariances(self) -> Any:
        return np.concatenate([step.covariance.reshape(-1, 12) for step in self.steps])

    @property
    def refused(self) -> dict[str, int]:
        return dict(self.feed.scene.refused)

    @property
    def names(self) -> list[str]:
        return [getattr(change, "name", f"-{change.object_id}") for change in self.changes]
