"""Compares the answers of a replay with the recorded ones, step by step, and reports the first difference."""

from __future__ import annotations

import numpy as np

from collision_monitor.codec import decode_states
from collision_monitor.errors import MessageError
from collision_monitor.pipeline.pipeline import Outputs
from collision_monitor.session.reader import Recorded
from collision_monitor.session.replaying.difference import (
    Difference,
    compare_alerts,
    compare_answers,
    compare_status,
    compare_within,
)
from collision_monitor.session.replaying.replay_report import ReplayReport


class Comparison:
    """Holds the answers of the last step until the recorded ones arrive. sequence: number of the compared message."""

    def __init__(self, report: ReplayReport) -> None:
        self.sequence = 0
        self._report = report
        self._expected: dict[str, list[bytes]] = {}  # by message type, in order
        self._states = b""  # the inputs of the last step
        self._last_differing_step = -1

    def expect(self, states: bytes, outputs: Outputs | None) -> None:
        """Store the answers to these states; None if the pipeline refused them."""
        self._states = states
        if outputs is not None:
            self._expected = {"ContactArray": [outputs.contacts], "PredictedCollisionArray": [outputs.predictions]}
            if outputs.alerts and self._report.tolerance is None:
                self._expected["CollisionAlert"] = list(outputs.alerts)

    def expect_nothing_more(self) -> None:
        """Report each answer of the last step that was not in the session."""
        for kind, messages in self._expected.items():
            for data in messages:
                nothing = f"a {kind} of {len(data)} bytes"
                self._note(Difference(self._report.steps, kind, "the message", "presence", "nothing", nothing))
        self._expected = {}

    def drop(self) -> None:
        """Forget the answers that have not been compared."""
        self._expected = {}

    def compare(self, message: Recorded) -> None:
        """Compare a recorded ContactArray, PredictedCollisionArray or CollisionAlert."""
        self._report.compared += 1
        step, tolerance = self._report.steps, self._report.tolerance
        expected = self._expected.get(message.type)
        replayed = expected.pop(0) if expected else None
        if replayed is None:
            recorded = f"a {message.type} of {len(message.data)} bytes"
            self._note(Difference(step, message.topic, "the message", "presence", recorded, "nothing"))
            return
        if message.type == "CollisionAlert":
            self._note(compare_alerts(message.topic, step, message.data, replayed))
            return
        difference = compare_answers(message.type, message.topic, step, message.data, replayed)
        if difference is not None and tolerance is not None:
            difference = compare_within(message.type, message.topic, step, message.data, replayed, tolerance)
            self._report.within += difference is None
        self._note(difference)

    def compare_status(self, message: Recorded, replayed: bytes) -> None:
        """Compare a recorded MonitorStatus."""
        self._report.compared += 1
        self._note(compare_status(message.topic, self._report.steps, message.data, replayed))

    def _note(self, difference: Difference | None) -> None:
        if difference is None:
            return
        report = self._report
        if report.first_difference is None:
            report.first_difference = difference
            report.first_message = self.sequence
            report.inputs = _states_in_words(self._states, difference.pair)
        if self._last_differing_step != difference.step:
            self._last_differing_step = difference.step
            report.differing += 1


def _states_in_words(data: bytes, pair: tuple[int, int] | None) -> list[str]:
    """Describe the states of the two objects in an ObjectStateArray. Missing ones are left out."""
    if pair is None or not data:
        return []
    try:
        message = decode_states(data)
    except MessageError:
        return []
    lines = []
    for row in message.states[np.isin(message.states["id"], pair)]:
        names = ("position", "quaternion", "linear", "angular")
        lines.append(
            f"object {row['id']} at {message.stamp_ns} ns: " + ", ".join(f"{n} {row[n].tolist()}" for n in names)
        )
    return lines
