"""7,500 hostile messages in this process, and the command that sends more."""

from __future__ import annotations

import base64
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import fuzz_messages
import known_scene
import numpy as np
import pytest
from campaign import START, Campaign, Failure, is_broken_by, load_kernels
from message_fuzzer import hostile_message

from collision_monitor.codec import ContactArray, PredictedCollisionArray, decode_contacts, decode_predictions
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.pipeline.topics import Topic
from collision_monitor.records import CONTACT

SEEDS = range(1, 4)
MESSAGES = 2_500
PREFIX = 200


@pytest.mark.parametrize("seed", SEEDS)
def test_no_message_breaks_the_pipeline_or_the_answers_to_a_known_scene(seed: int) -> None:
    summary = Campaign(seed).run(MESSAGES)
    assert [f"{each.index}: {each.problem}" for each in summary.failures] == []
    assert summary.messages == MESSAGES
    assert summary.accepted > 0.3 * MESSAGES, "the known scene was asked"
    assert summary.restarts == MESSAGES // 1_250
    assert all(summary.refused[reason] > 0 for reason in summary.refused), "every reason for a refusal occurred"


def test_the_same_seed_gives_the_same_messages_and_the_same_digest() -> None:
    first, second = (Campaign(5).run(PREFIX) for _ in range(2))
    assert first.digest == second.digest != Campaign(6).run(PREFIX).digest
    messages = [[hostile_message(5, index, START) for index in range(100)] for _ in range(2)]
    assert messages[0] == messages[1]
    assert len({message.data for message in messages[0]}) > 95


def test_the_fuzzer_makes_valid_and_invalid_content_of_every_kind() -> None:
    """Most messages are accepted, so that hostile ones meet a monitor at work."""
    campaign = Campaign(1)
    campaign.run(500)
    assert campaign.summary.steps > 400
    assert any(each.static for each in campaign.pipeline.catalogue.descriptions.values())
    messages = [hostile_message(1, index, START) for index in range(2000)]
    assert max(len(message.data) for message in messages if message.topic is Topic.SHAPES) > 250_000


# -- the checks themselves find what they should


def answers() -> tuple[ContactArray, PredictedCollisionArray]:
    pipeline = Pipeline()
    pipeline.on_shapes(known_scene.descriptions(START, snapshot=True))
    outputs = pipeline.on_states(known_scene.states(1, 0, START))
    assert outputs is not None
    return decode_contacts(outputs.contacts), decode_predictions(outputs.predictions)


def test_the_known_scene_is_answered_right_and_any_other_answer_is_noticed() -> None:
    contacts, predictions = answers()
    assert known_scene.wrong(1, contacts, predictions) == []
    without = replace(contacts, contacts=contacts.contacts[:0])
    assert "not reported" in known_scene.wrong(1, without, predictions)[0]
    off = contacts.contacts.copy()
    off["signed_distance"] += 0.01
    assert "expected -0.1 m" in known_scene.wrong(1, replace(contacts, contacts=off), predictions)[0]
    missed = replace(predictions, predictions=predictions.predictions[:0])
    assert "meets the wall" in known_scene.wrong(1, contacts, missed)[0]
    late = predictions.predictions.copy()
    late["lower"] += 0.1
    late["upper"] += 0.1
    assert "the ball: expected" in known_scene.wrong(1, contacts, replace(predictions, predictions=late))[0]
    false = np.zeros(1, CONTACT)
    false["id_a"], false["id_b"] = known_scene.NORTH, known_scene.SOUTH
    more = replace(contacts, contacts=np.concatenate([contacts.contacts, false]))
    assert "do not touch" in known_scene.wrong(1, more, predictions)[0]


def test_an_exception_a_slow_input_and_a_wrong_answer_are_failures(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(self: Pipeline, data: bytes) -> None:
        raise ZeroDivisionError("on purpose")

    load_kernels()
    with monkeypatch.context() as patched:
        patched.setattr(Pipeline, "on_settings", broken)
        (failure,) = Campaign(1).run(300).failures
        assert failure.topic == "SETTINGS" and "on purpose" in failure.problem
        assert "on purpose" in "".join(is_broken_by(Topic.SETTINGS, base64.b64decode(failure.data)))
    with monkeypatch.context() as patched:
        patched.setattr("campaign.SLOWEST", 1e-6)
        (failure,) = Campaign(1).run(300).failures
        assert "bytes took" in failure.problem
    with monkeypatch.context() as patched:
        patched.setattr("known_scene.DEPTH", 0.101)
        patched.setattr("known_scene.states", lambda *_, states=known_scene.states: _with_depth(states, *_))
        assert "the two cubes" in Campaign(1).run(300).failures[0].problem


def _with_depth(states: object, *arguments: int) -> bytes:
    known_scene.DEPTH, depth = 0.1, known_scene.DEPTH
    try:
        return states(*arguments)  # type: ignore[operator]
    finally:
        known_scene.DEPTH = depth


def test_the_command_sends_the_same_messages_in_another_process_and_saves_what_fails(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = [sys.executable, str(Path(__file__).with_name("fuzz_messages.py"))]
    environment = {**os.environ, "PYTHONHASHSEED": "7"}
    run = subprocess.run(
        [*command, "--messages", str(PREFIX), "--seed", "5", "--json", "--folder", str(tmp_path)],
        env=environment, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr + run.stdout
    report = json.loads(run.stdout)
    assert report["messages"] == PREFIX
    assert report["digests"] == {"5": f"{Campaign(5).run(PREFIX).digest:016x}"}
    saved = Failure(5, 3, "once broken", "STATES", base64.b64encode(b"\0\1\0\0").decode()).save(tmp_path)
    assert fuzz_messages.main(["--reproduce", str(saved)]) == 0
    assert capsys.readouterr().out == "it breaks nothing any more\n"
