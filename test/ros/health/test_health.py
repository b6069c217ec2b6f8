"""The levels of the diagnostics: ERROR for answers that must not be relied on, WARN for what needs attention."""

from __future__ import annotations

import math
from typing import Any

import pytest

from collision_monitor.alerts.rules_in_force import RuleInForce
from collision_monitor.codec import MonitorStatus
from collision_monitor.ros.health.health import HISTORY, DiagnosticLevel, LastReports, NodeFacts, Report, reports
from collision_monitor.ros.health.line_report import LineReport
from collision_monitor.session import Recording

GOOD = {"step": 9, "objects": 3, "latency": 0.002, "rate": 50.0, "step_duration_p99": 0.001}


def facts(status: dict[str, Any] | None = None, **changes: Any) -> NodeFacts:
    given = {"silence": 0.01, "stale": "", "unseen": "", "deferred": 0, "unresolved": 0, "other_nodes": 0}
    given |= {"outdated": 0, "is_reduced": False, "longest": 0.004, "longest_step": 7, **changes}
    return NodeFacts(status=MonitorStatus(**{**GOOD, **(status or {})}), topic="/states", stale_after=0.5, **given)


def by_task(found: list[Report]) -> dict[str, Report]:
    return {report.task: report for report in found}


def test_all_is_well() -> None:
    found = reports("active", "", facts(), LastReports())
    assert [report.task for report in found] == ["state", "inputs", "steps", "recording"]
    assert {report.level for report in found} == {DiagnosticLevel.OK}
    assert [report.text for report in found] == ["active", "3 objects, all up to date", "50 steps/s", "not recording"]
    values = by_task(found)["steps"].values
    assert (values["longest step [s]"], values["longest step number"]) == ("0.004", "7")


@pytest.mark.parametrize(
    ("given", "task", "level", "text"),
    [
        (facts(silence=0.7), "inputs", DiagnosticLevel.ERROR, "silent: no newer states on /states for 0.7 s"),
        (facts(stale="4 ('fork')"), "inputs", DiagnosticLevel.ERROR, "stale: no usable new state of object 4 ('fork')"),
        (
            facts({"objects_unseen": 1}, unseen="4 ('x')"),
            "inputs",
            DiagnosticLevel.ERROR,
            "unseen: no state yet of object 4 ('x')",
        ),
        (facts({"refused_unknown_id": 2}), "inputs", DiagnosticLevel.ERROR, "refused lately: 2 unknown_id"),
        (facts({"refused_shape": 1}), "inputs", DiagnosticLevel.ERROR, "refused lately: 1 shape"),
        (
            facts({"refused_frame": 7, "last_refusal": "why"}),
            "inputs",
            DiagnosticLevel.WARN,
            "lately: 7 frame (last: why)",
        ),
        (facts({"messages_lost": 4}), "inputs", DiagnosticLevel.WARN, "lost lately: 4 messages on /states"),
        (
            facts({"objects": 0, "step": 0, "latency": math.nan}),
            "inputs",
            DiagnosticLevel.WARN,
            "no object is described",
        ),
        (facts({"latency": 0.6}), "steps", DiagnosticLevel.ERROR, "late: the answers are 0.60 s behind"),
        (facts({"latency": math.nan}), "steps", DiagnosticLevel.WARN, "from another clock"),
        (
            facts(unresolved=3),
            "steps",
            DiagnosticLevel.WARN,
            "unresolved: up to 3 pairs in a step; treat them as colliding",
        ),
        (facts(deferred=5), "steps", DiagnosticLevel.WARN, "deferred: the budget ran out, up to 5 pairs in a step"),
        (
            facts({"step_duration_p99": 0.03}),
            "steps",
            DiagnosticLevel.WARN,
            "slow: 1 % of the steps take 30.0 ms or more at 50 Hz",
        ),
        (
            facts(outdated=7),
            "steps",
            DiagnosticLevel.WARN,
            "slower than the states: 7 outdated messages left out lately",
        ),
        (
            facts({"profile": "balanced, reduced to 64 samples"}, is_reduced=True),
            "steps",
            DiagnosticLevel.WARN,
            "reduced effort: profile balanced, reduced to 64 samples",
        ),
        (facts(other_nodes=1), "state", DiagnosticLevel.ERROR, "another node of this name"),
        (
            facts({"recording": Recording.FAILED, "recording_error": "no space"}),
            "recording",
            DiagnosticLevel.WARN,
            "the recording failed, the monitoring goes on: no space",
        ),
        (
            facts({"recording": Recording.ON, "recording_dropped": 8}),
            "recording",
            DiagnosticLevel.WARN,
            "the disk is too slow: 8 messages dropped lately",
        ),
        (
            facts({"recording": Recording.ON, "recording_path": "a"}),
            "recording",
            DiagnosticLevel.OK,
            "recording to a",
        ),
    ],
)
def test_each_problem_has_its_level_and_only_its_own_report(
    given: NodeFacts, task: str, level: DiagnosticLevel, text: str
) -> None:
    found = by_task(reports("active", "", given, LastReports()))
    assert found[task].level == level
    assert text in found[task].text
    assert {report.level for other, report in found.items() if other != task} == {DiagnosticLevel.OK}


def test_the_worst_is_named_first() -> None:
    inputs = by_task(reports("active", "", facts({"messages_lost": 1}, stale="1 ('a')"), LastReports()))["inputs"]
    assert (inputs.level, inputs.text.split(":")[0]) == (DiagnosticLevel.ERROR, "stale")


def test_static_objects_alone_need_no_states() -> None:
    found = by_task(reports("active", "", facts({"objects": 3, "objects_static": 3}, silence=99.0), LastReports()))
    assert found["inputs"].level == DiagnosticLevel.OK


def test_a_counter_that_grows_no_more_is_reported_for_ten_reports() -> None:
    history = LastReports()
    levels = [by_task(reports("active", "", facts({"refused_frame": 1}), history))["inputs"].level for _ in range(13)]
    assert levels == [DiagnosticLevel.WARN] * HISTORY + [DiagnosticLevel.OK] * (13 - HISTORY)


def source(refused: int, level: DiagnosticLevel = DiagnosticLevel.OK, text: str = "ok") -> LineReport:
    return LineReport("cart", "/odom", "nav_msgs/msg/Odometry", 9, 9, refused, "why" if refused else "", 0, level, text)


@pytest.mark.parametrize(
    ("line", "level", "text"),
    [
        (source(0), DiagnosticLevel.OK, "1 topics"),
        (source(3, DiagnosticLevel.WARN, "why"), DiagnosticLevel.WARN, "refused lately: 3 of cart (last: why)"),
        (source(0, DiagnosticLevel.WARN, "/odom has no publisher"), DiagnosticLevel.WARN, "/odom has no publisher"),
        (
            source(3, DiagnosticLevel.ERROR, "cart: not installed"),
            DiagnosticLevel.ERROR,
            "unusable: cart: not installed",
        ),
    ],
)
def test_sources_are_reported_with_a_file(line: LineReport, level: DiagnosticLevel, text: str) -> None:
    found = by_task(reports("active", "", facts(sources=(line,)), LastReports()))
    assert (found["sources"].level, found["sources"].text) == (level, text)
    assert found["sources"].values == {"messages": "9", "refused": str(line.refused)}
    assert {report.level for task, report in found.items() if task != "sources"} == {DiagnosticLevel.OK}


def test_a_source_that_refuses_no_more_is_reported_for_ten_reports() -> None:
    history, given = LastReports(), facts(sources=(source(1, DiagnosticLevel.WARN, "why"),))
    levels = [by_task(reports("active", "", given, history))["sources"].level for _ in range(13)]
    assert levels == [DiagnosticLevel.WARN] * HISTORY + [DiagnosticLevel.OK] * (13 - HISTORY)


@pytest.mark.parametrize(
    ("failure", "level"), [("", DiagnosticLevel.WARN), ("configure failed: OSError()", DiagnosticLevel.ERROR)]
)
def test_without_a_configuration_there_is_nothing_to_report(failure: str, level: DiagnosticLevel) -> None:
    found = reports("unconfigured", failure, None, LastReports())
    assert [report.level for report in found] == [level, *[DiagnosticLevel.STALE] * 3]
    assert "unconfigured: no answers are published" in found[0].text
    assert failure in found[0].text


def test_what_the_sources_file_asks_for_and_is_not_monitored_is_an_error_until_it_is_there() -> None:
    line = LineReport("cart", "/odom", "nav_msgs/msg/Odometry", 5, 5, 0, "", 0, DiagnosticLevel.OK, "ok")
    texts = tuple(f"shelf_{k}: no frame" for k in range(7))
    history = LastReports()
    found = by_task(reports("active", "", facts(sources=(line,), unmonitored=texts), history))["sources"]
    assert found.level == DiagnosticLevel.ERROR
    assert found.text.startswith("not monitored: shelf_0: no frame; not monitored: shelf_1: no frame")
    assert found.text.endswith("not monitored: 2 more, see ~/sources")
    assert found.values["not monitored"] == "7"
    found = by_task(reports("active", "", facts(sources=(line,)), history))["sources"]
    assert (found.level, found.text) == (DiagnosticLevel.OK, "1 topics")


def test_a_rule_that_covers_nobody_is_a_warning() -> None:
    good = RuleInForce("guard", "covers robot_1 against every other object", True, {})
    bad = RuleInForce("people", "covers nobody", False, {})
    assert "rules" not in by_task(reports("active", "", facts(), LastReports()))
    found = by_task(reports("active", "", facts(rules=(good,)), LastReports()))["rules"]
    assert (found.level, found.text) == (DiagnosticLevel.OK, "1 in force, each covers somebody")
    found = by_task(reports("active", "", facts(rules=(good, bad)), LastReports()))["rules"]
    assert (found.level, found.text) == (DiagnosticLevel.WARN, "rule 'people' covers nobody")
    assert found.values == {"guard": good.summary, "people": bad.summary}
