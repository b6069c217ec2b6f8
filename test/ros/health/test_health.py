"""The levels of the diagnostics: ERROR for answers that must not be relied on, WARN for what needs attention."""

from __future__ import annotations

import math
from typing import Any

import pytest

from collision_monitor.codec import MonitorStatus
from collision_monitor.ros.health.health import HISTORY, Facts, History, Level, Report, reports
from collision_monitor.ros.health.line_report import LineReport
from collision_monitor.session import Recording

GOOD = {"step": 9, "objects": 3, "latency": 0.002, "rate": 50.0, "step_duration_p99": 0.001}


def facts(status: dict[str, Any] | None = None, **changes: Any) -> Facts:
    given = {"silence": 0.01, "stale": "", "unseen": "", "deferred": 0, "unresolved": 0, "other_nodes": 0}
    given |= {"outdated": 0, "is_reduced": False, "longest": 0.004, "longest_step": 7, **changes}
    return Facts(status=MonitorStatus(**{**GOOD, **(status or {})}), topic="/states", stale_after=0.5, **given)


def by_task(found: list[Report]) -> dict[str, Report]:
    return {report.task: report for report in found}


def test_all_is_well() -> None:
    found = reports("active", "", facts(), History())
    assert [report.task for report in found] == ["state", "inputs", "steps", "recording"]
    assert {report.level for report in found} == {Level.OK}
    assert [report.text for report in found] == ["active", "3 objects, all up to date", "50 steps/s", "not recording"]
    values = by_task(found)["steps"].values
    assert (values["longest step [s]"], values["longest step number"]) == ("0.004", "7")


@pytest.mark.parametrize(
    ("given", "task", "level", "text"),
    [
        (facts(silence=0.7), "inputs", Level.ERROR, "silent: no newer states on /states for 0.7 s"),
        (facts(stale="4 ('fork')"), "inputs", Level.ERROR, "stale: no usable new state of object 4 ('fork')"),
        (
            facts({"objects_unseen": 1}, unseen="4 ('x')"),
            "inputs",
            Level.ERROR,
            "unseen: no state yet of object 4 ('x')",
        ),
        (facts({"refused_unknown_id": 2}), "inputs", Level.ERROR, "refused lately: 2 unknown_id"),
        (facts({"refused_shape": 1}), "inputs", Level.ERROR, "refused lately: 1 shape"),
        (facts({"refused_frame": 7, "last_refusal": "why"}), "inputs", Level.WARN, "lately: 7 frame (last: why)"),
        (facts({"messages_lost": 4}), "inputs", Level.WARN, "lost lately: 4 messages on /states"),
        (facts({"objects": 0, "step": 0, "latency": math.nan}), "inputs", Level.WARN, "no object is described"),
        (facts({"latency": 0.6}), "steps", Level.ERROR, "late: the answers are 0.60 s behind"),
        (facts({"latency": math.nan}), "steps", Level.WARN, "from another clock"),
        (facts(unresolved=3), "steps", Level.WARN, "unresolved: up to 3 pairs in a step; treat them as colliding"),
        (facts(deferred=5), "steps", Level.WARN, "deferred: the budget ran out, up to 5 pairs in a step"),
        (
            facts({"step_duration_p99": 0.03}),
            "steps",
            Level.WARN,
            "slow: 1 % of the steps take 30.0 ms or more at 50 Hz",
        ),
        (facts(outdated=7), "steps", Level.WARN, "slower than the states: 7 outdated messages left out lately"),
        (
            facts({"profile": "balanced, reduced to 64 samples"}, is_reduced=True),
            "steps",
            Level.WARN,
            "reduced effort: profile balanced, reduced to 64 samples",
        ),
        (facts(other_nodes=1), "state", Level.ERROR, "another node of this name"),
        (
            facts({"recording": Recording.FAILED, "recording_error": "no space"}),
            "recording",
            Level.WARN,
            "the recording failed, the monitoring goes on: no space",
        ),
        (
            facts({"recording": Recording.ON, "recording_dropped": 8}),
            "recording",
            Level.WARN,
            "the disk is too slow: 8 messages dropped lately",
        ),
        (facts({"recording": Recording.ON, "recording_path": "a"}), "recording", Level.OK, "recording to a"),
    ],
)
def test_each_problem_has_its_level_and_only_its_own_report(given: Facts, task: str, level: Level, text: str) -> None:
    found = by_task(reports("active", "", given, History()))
    assert found[task].level == level
    assert text in found[task].text
    assert {report.level for other, report in found.items() if other != task} == {Level.OK}


def test_the_worst_is_named_first() -> None:
    inputs = by_task(reports("active", "", facts({"messages_lost": 1}, stale="1 ('a')"), History()))["inputs"]
    assert (inputs.level, inputs.text.split(":")[0]) == (Level.ERROR, "stale")


def test_static_objects_alone_need_no_states() -> None:
    found = by_task(reports("active", "", facts({"objects": 3, "objects_static": 3}, silence=99.0), History()))
    assert found["inputs"].level == Level.OK


def test_a_counter_that_grows_no_more_is_reported_for_ten_reports() -> None:
    history = History()
    levels = [by_task(reports("active", "", facts({"refused_frame": 1}), history))["inputs"].level for _ in range(13)]
    assert levels == [Level.WARN] * HISTORY + [Level.OK] * (13 - HISTORY)


def source(refused: int, level: Level = Level.OK, text: str = "ok") -> LineReport:
    return LineReport("cart", "/odom", "nav_msgs/msg/Odometry", 9, 9, refused, "why" if refused else "", 0, level, text)


@pytest.mark.parametrize(
    ("line", "level", "text"),
    [
        (source(0), Level.OK, "1 topics"),
        (source(3, Level.WARN, "why"), Level.WARN, "refused lately: 3 of cart (last: why)"),
        (source(0, Level.WARN, "/odom has no publisher"), Level.WARN, "/odom has no publisher"),
        (source(3, Level.ERROR, "cart: not installed"), Level.ERROR, "unusable: cart: not installed"),
    ],
)
def test_sources_are_reported_with_a_file(line: LineReport, level: Level, text: str) -> None:
    found = by_task(reports("active", "", facts(sources=(line,)), History()))
    assert (found["sources"].level, found["sources"].text) == (level, text)
    assert found["sources"].values == {"messages": "9", "refused": str(line.refused)}
    assert {report.level for task, report in found.items() if task != "sources"} == {Level.OK}


def test_a_source_that_refuses_no_more_is_reported_for_ten_reports() -> None:
    history, given = History(), facts(sources=(source(1, Level.WARN, "why"),))
    levels = [by_task(reports("active", "", given, history))["sources"].level for _ in range(13)]
    assert levels == [Level.WARN] * HISTORY + [Level.OK] * (13 - HISTORY)


@pytest.mark.parametrize(("failure", "level"), [("", Level.WARN), ("configure failed: OSError()", Level.ERROR)])
def test_without_a_configuration_there_is_nothing_to_report(failure: str, level: Level) -> None:
    found = reports("unconfigured", failure, None, History())
    assert [report.level for report in found] == [level, *[Level.STALE] * 3]
    assert "unconfigured: no answers are published" in found[0].text
    assert failure in found[0].text
