"""The page colours by alerts if the monitor has rules for them: live, in a session, in a replay."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from alert_scene import STEP_NS, AlertScene, rules_of
from played_session import NODE, TYPES

from collision_monitor.alerts.rules import Rules
from collision_monitor.codec import decode_alert, encode_descriptions
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.session import Recorder, Session
from collision_monitor.shapes.registry import Sphere
from collision_monitor.view.levels import COLORS, Level
from collision_monitor.view.picture import Role, draw
from collision_monitor.view.recording import RecordedSteps
from collision_monitor.view.topic_content import TopicContent

OBJECTS = [ObjectDescription(1, Sphere(0.5), name="cart 1"), ObjectDescription(2, Sphere(0.3), name="person 2")]
ALWAYS = ", quiet_at_rest: false, quiet_when_parting: false"
RULES = rules_of("caution: {distance: 1.5}, critical: {distance: 0.5}", ALWAYS)
ALERTS = f"{NODE}/alerts"


def record(path: Path, rules: Rules, steps: int = 60) -> dict[int, int]:
    """Record a cart that approaches a person and returns. Return the level of the alert after each step, from 1."""
    scene = AlertScene(OBJECTS, rules)
    types = {**TYPES, ALERTS: "CollisionAlert"}
    recorder = Recorder(path, types, scene.pipeline.metadata(node=NODE), patient=True)
    shapes, states, contacts, predictions, _ = TYPES
    recorder.write(shapes, encode_descriptions(0, "world", OBJECTS), 0, 0)
    levels, level = {}, 0
    for k in range(steps):
        x = 0.1 * min(k, steps - k)
        data = scene.message({1: ((x, 0, 0), (0, 0, 0)), 2: ((4, 0, 0), (0, 0, 0))}, k * STEP_NS)
        scene.step += 1
        outputs = scene.pipeline.on_states(data)
        assert outputs is not None
        recorder.write(states, data, k * STEP_NS, k * STEP_NS)
        recorder.write(contacts, outputs.contacts, k * STEP_NS, k * STEP_NS)
        recorder.write(predictions, outputs.predictions, k * STEP_NS, k * STEP_NS)
        for alert in outputs.alerts:
            level = decode_alert(alert).level
            recorder.write(ALERTS, alert, k * STEP_NS, k * STEP_NS)
        levels[k] = level
    recorder.close()
    return levels


def test_a_session_shows_its_alerts_back_and_forth(tmp_path: Path) -> None:
    levels = record(tmp_path / "a.mcap", RULES)
    assert set(levels.values()) == {0, 1, 3}
    recording, replayed = RecordedSteps(Session(tmp_path / "a.mcap")), RecordedSteps(Session(tmp_path / "a.mcap"), "")
    colors = {0: Level.CLEAR, 1: Level.CAUTION, 3: Level.CRITICAL}
    for k in [59, 0, *np.random.default_rng(1).permutation(60).tolist()]:
        moment = recording.moment(k)
        assert moment.alerts == ({(1, 2): colors[levels[k]]} if levels[k] else {})
        assert replayed.moment(k).alerts == moment.alerts
        batch = draw(moment, alerts=True).batches[Role.MOVING, "sphere"]
        assert (batch.color == COLORS[colors[levels[k]]]).all()


def test_a_session_without_rules_is_coloured_by_the_answers(tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", Rules(), steps=3)
    assert RecordedSteps(Session(tmp_path / "a.mcap")).moment(2).alerts is None


def test_live_alerts_hold_as_long_as_they_are_repeated() -> None:
    source, scene = AlertScene(OBJECTS, RULES), TopicContent()
    scene.take("ObjectDescriptionArray", encode_descriptions(0, "world", OBJECTS))

    def feed(step: int) -> None:
        data = source.message({1: ((2.5, 0, 0), (0, 0, 0)), 2: ((4, 0, 0), (0, 0, 0))}, step * STEP_NS)
        outputs = source.pipeline.on_states(data)
        assert outputs is not None
        scene.take("ObjectStateArray", data)
        scene.take("ContactArray", outputs.contacts)
        scene.take("PredictedCollisionArray", outputs.predictions)

    feed(10)
    assert scene.moment().alerts is None
    scene.take("CollisionAlertArray", source.pipeline.raised_alerts())
    assert scene.moment().alerts == {(1, 2): Level.CAUTION}
    feed(30)
    assert scene.moment().alerts == {(1, 2): Level.CAUTION}
    feed(60)  # the rules were removed
    assert scene.moment().alerts is None
