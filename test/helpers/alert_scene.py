"""Pipelines with rules, stepped with states that a test computes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from collision_monitor.alerts.rules import Rules
from collision_monitor.codec import CollisionAlert, decode_alert, encode_descriptions, encode_states
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.records import STATE

STEP_NS = 50_000_000
States = dict[int, Sequence[Any]]
CLASSES = 'classes: {cart: ["cart*"], person: ["person*"]}\n'


def rules_of(levels: str, more: str = "", top: str = "") -> Rules:
    """One rule `near` between carts and persons. levels: flow YAML of the levels; more: further keys of the rule."""
    return Rules.parse(f"{CLASSES}{top}\nrules: {{near: {{between: [cart, person], {levels}{more}}}}}\n")


class AlertScene:
    """A pipeline with rules. at(k): states by id in step k, as (position, linear) or (position, linear, angular)."""

    def __init__(self, objects: Sequence[ObjectDescription], rules: Rules, **options: Any) -> None:
        self.pipeline = Pipeline(rules=rules, **options)
        self.step = 0
        self.describe(*objects)

    def describe(self, *objects: Any) -> None:
        self.pipeline.on_shapes(encode_descriptions(0, "world", list(objects)))

    def message(self, states: States, stamp_ns: int) -> bytes:
        rows = np.zeros(len(states), STATE)
        rows["quaternion"][:, 3] = 1.0
        for row, (object_id, (position, *twist)) in zip(rows, sorted(states.items()), strict=True):
            row["id"], row["position"] = object_id, position
            for name, value in zip(("linear", "angular"), twist, strict=False):
                row[name] = value
        return encode_states(stamp_ns, "world", self.step, rows)

    def feed(self, states: States, stamp_ns: int | None = None) -> list[CollisionAlert]:
        """Take one step; return its alerts."""
        data = self.message(states, self.step * STEP_NS if stamp_ns is None else stamp_ns)
        self.step += 1
        outputs = self.pipeline.on_states(data)
        return [] if outputs is None else list(map(decode_alert, outputs.alerts))

    def run(self, at: Callable[[float], States], steps: int) -> Iterator[tuple[float, CollisionAlert]]:
        """Take steps; yield each alert with its time (s)."""
        for _ in range(steps):
            time = self.step * STEP_NS * 1e-9
            yield from ((time, alert) for alert in self.feed(at(time)))
