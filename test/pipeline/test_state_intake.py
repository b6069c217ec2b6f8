"""The way of an ObjectStateArray: decoded once, one step under one clock, refusals before anything is stored."""

from __future__ import annotations

import ast
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from collision_monitor import codec, records
from collision_monitor.errors import Refusal
from collision_monitor.monitor.budget import StepClock
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.pipeline import state_intake
from collision_monitor.pipeline.pipeline import Outputs, Pipeline
from collision_monitor.pipeline.state_intake import ReceivedStates
from collision_monitor.shapes.registry import Sphere

PACKAGE = Path(codec.__file__).parents[1]


def message(stamp_ns: int = 0, frame: str = "world", sequence: int = 1, covariance: int = 0) -> bytes:
    states = np.zeros(1, records.STATE)
    states["id"], states["quaternion"][:, 3] = 1, 1.0
    return codec.encode_states(stamp_ns, frame, sequence, states, np.zeros(covariance))


@pytest.fixture
def pipeline() -> Pipeline:
    pipeline = Pipeline()
    pipeline.monitor.add(1, Sphere(0.5), name="ball")
    return pipeline


@pytest.fixture
def entered(monkeypatch: pytest.MonkeyPatch) -> list[StepClock]:
    """The clocks that were entered, one entry for each time."""
    found: list[StepClock] = []
    enter = StepClock.__enter__
    monkeypatch.setattr(StepClock, "__enter__", lambda clock: found.append(clock) or enter(clock))
    return found


def calls_of(name: str, *folders: str) -> set[str]:
    """Modules of the folders that call a function of this name."""
    found = set()
    for path in (path for folder in folders for path in (PACKAGE / folder).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            function = getattr(node, "func", None)
            if name in (getattr(function, "id", None), getattr(function, "attr", None)):
                found.add(path.relative_to(PACKAGE).as_posix())
    return found


def test_one_file_decodes_the_states_that_the_node_and_the_pipeline_process() -> None:
    assert calls_of("decode_states", "pipeline", "ros/monitor", "ros/health") == {"pipeline/state_intake.py"}


def test_the_node_asks_the_pipeline_and_not_the_monitor_behind_it() -> None:
    for path in (PACKAGE / "ros").rglob("*.py"):
        through = [node for node in ast.walk(ast.parse(path.read_text())) if _is_monitor_of_a_pipeline(node)]
        assert not through, f"{path}, line {through[0].lineno}: give Pipeline what is needed there"


def _is_monitor_of_a_pipeline(node: ast.AST) -> bool:
    if not (isinstance(node, ast.Attribute) and node.attr == "monitor"):
        return False
    owner = node.value
    return "pipeline" in (getattr(owner, "attr", "") or getattr(owner, "id", "")).lower()


def test_a_message_that_was_decoded_is_not_decoded_again(pipeline: Pipeline, monkeypatch: pytest.MonkeyPatch) -> None:
    received = ReceivedStates.decode(message())
    monkeypatch.setattr(state_intake, "decode_states", None)  # a call would raise TypeError
    outputs = pipeline.take_states(received)
    assert outputs is not None and outputs.result.step == 1


@pytest.mark.parametrize(
    "step",
    [
        lambda pipeline: pipeline.monitor.step(0, [1], [(0, 0, 0, 0, 0, 0, 1)]),
        lambda pipeline: pipeline.on_states(message()),
        lambda pipeline: pipeline.take_states(ReceivedStates.decode(message()), None, lambda outputs: None),
        lambda pipeline: pipeline.on_states(message(frame="moon")),
        lambda pipeline: pipeline.on_states(b"\xff" * 7),
    ],
    ids=["library", "replay", "node", "another frame", "no message"],
)
def test_the_clock_is_entered_once_a_step(
    pipeline: Pipeline, entered: list[StepClock], step: Callable[[Pipeline], object]
) -> None:
    step(pipeline)
    assert entered == [pipeline.monitor.clock]


def test_answers_are_published_while_the_clock_runs(pipeline: Pipeline, monkeypatch: pytest.MonkeyPatch) -> None:
    events: list[str] = []
    leave = StepClock.__exit__
    monkeypatch.setattr(StepClock, "__exit__", lambda clock, *of: events.append("stopped") or leave(clock, *of))

    def publish(outputs: Outputs) -> None:
        assert outputs.result is pipeline.monitor.last
        events.append("published")

    assert pipeline.take_states(ReceivedStates.decode(message()), None, publish) is not None
    assert events == ["published", "stopped"]


@pytest.mark.parametrize(
    ("data", "reason", "text"),
    [
        (b"\xff" * 7, Refusal.MALFORMED, "ObjectStateArray"),
        (message()[:-3], Refusal.MALFORMED, "ObjectStateArray"),
        (message(frame="moon"), Refusal.FRAME, "ObjectStateArray: expected frame_id 'world', got 'moon'"),
        (message(covariance=5), Refusal.MALFORMED, "expected none or 12 numbers for each of 1 states, got 5"),
    ],
    ids=["no message", "truncated", "another frame", "covariance"],
)
def test_a_refused_message_is_counted_and_nothing_is_published(
    pipeline: Pipeline, data: bytes, reason: Refusal, text: str
) -> None:
    published: list[Outputs] = []
    assert pipeline.take_states(ReceivedStates.decode(data), None, published.append) is None
    assert pipeline.refused[reason] == sum(pipeline.refused.values()) == 1
    assert text in pipeline.refusal_texts[reason]
    assert not published and pipeline.monitor.last is None


@pytest.mark.parametrize(
    ("numbers", "lost"),
    [
        ([1, 2, 3], 0),
        ([1, 5, 6], 3),
        ([7, 7, 7], 0),
        ([0, 0, 0], 0),  # a publisher that does not count
        ([0xFFFFFFFE, 0xFFFFFFFF, 0, 1], 0),  # the wrap
        ([0xFFFFFFFF, 2], 2),
        ([9, 3, 4], 0),  # a restart of the publisher
    ],
)
def test_lost_messages_are_counted_by_their_numbers(pipeline: Pipeline, numbers: list[int], lost: int) -> None:
    for k, sequence in enumerate(numbers):
        assert pipeline.on_states(message(k * 10_000_000, sequence=sequence)) is not None
    assert codec.decode_status(pipeline.status()).messages_lost == lost
    restored = Pipeline.restored(pipeline.snapshot(), "world")
    assert codec.decode_status(restored.status()).messages_lost == lost


def test_the_pipeline_names_the_objects_that_are_stale_and_those_without_a_state(pipeline: Pipeline) -> None:
    pipeline.monitor.add(2, Sphere(0.5), name="lorry")
    assert (pipeline.stale(), pipeline.unseen()) == ({}, {1: "ball", 2: "lorry"})
    pipeline.on_states(message())
    states = codec.decode_states(message()).states.copy()
    states["id"], states["position"] = 2, 9.0
    late = round(1e9 * pipeline.profile.stale_after) + 1_000_000
    pipeline.on_states(codec.encode_states(late, "world", 2, states))
    assert (pipeline.stale(), pipeline.unseen()) == ({1: "ball"}, {})


def test_a_step_of_the_library_warns_and_one_of_a_caller_with_the_clock_does_not(
    recwarn: pytest.WarningsRecorder,
) -> None:
    given = state_intake.Observation(0, [9], [(0, 0, 0, 0, 0, 0, 1)])
    monitor = Monitor()
    with monitor.clock:
        assert monitor.take_step(given).refused[0].reason is Refusal.UNKNOWN_ID
    assert not recwarn
    with pytest.warns(UserWarning, match="got 9") as caught:
        monitor.step(1, [9], [(0, 0, 0, 0, 0, 0, 1)])
    assert caught[0].filename == __file__
