"""Checks sessions against expectations, and writes the outcomes as JUnit XML."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

from collision_monitor.alerts.rules import Rules
from collision_monitor.session.history.expectations import ExpectationResult, evaluate_expectations, parse_expectations
from collision_monitor.session.history.read_history import read_history
from collision_monitor.session.many_sessions import ALL_CORES, Engine, for_each
from collision_monitor.session.reader import Session
from collision_monitor.session.replaying.replay import replay

_NOT_XML: Final = re.compile("[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that a name may hold and XML may not."""


@dataclass(frozen=True)
class Checked:
    """A session and its outcomes, or the reason why it could not be read. seconds: time to read and check it."""

    session: str
    outcomes: list[ExpectationResult] = field(default_factory=list)
    error: str = ""
    seconds: float = field(default=0.0, compare=False)

    @property
    def holds(self) -> bool:
        """Whether the session was read and all expectations hold."""
        return not self.error and all(each.holds for each in self.outcomes)


def check_session(
    path: Path, expectations: Any, with_profile: str | None = None, rules: Rules | None = None
) -> Checked:
    """Check one session against the content from `read_expectations`. Raises SessionError, ProfileError.

    with_profile: check the answers of this program with that profile, or AS_RECORDED, instead of the recorded answers.
    rules: replace those of the session.
    """
    begin = time.perf_counter()
    history = read_history(Session(path), with_profile, rules=rules)
    outcomes = evaluate_expectations(parse_expectations(expectations), history, lambda: replay_verdict(path))
    return Checked(str(path), outcomes, seconds=time.perf_counter() - begin)


def _unread(path: Path, why: str) -> Checked:
    return Checked(str(path), error=why)


def replay_verdict(path: Path) -> str:
    """Replay the session and return the verdict in words: `identical`, or the difference. Raises SessionError."""
    report = replay(Session(path))
    text = report.verdict.name.lower().replace("_", " ")
    return text if report.first_difference is None else f"{text}: {report.first_difference}"


def check_sessions(
    paths: Sequence[Path],
    expectations: Any,
    *,
    with_profile: str | None = None,
    rules: Rules | None = None,
    engine: Engine = ALL_CORES,
) -> Iterator[Checked]:
    """Yield the outcomes of each session, in order. Raises the errors of `for_each`."""
    each = partial(check_session, expectations=expectations, with_profile=with_profile, rules=rules)
    for path, checked in zip(paths, for_each(each, paths, _unread, engine), strict=True):
        yield replace(checked, session=str(path))  # the path as the caller gave it


def junit_xml(results: Sequence[Checked]) -> str:
    """Return the results as JUnit XML, with a suite for each session and a case for each expectation."""
    total = sum(each.seconds for each in results)
    root = ElementTree.Element("testsuites", name="collision-monitor check", time=f"{total:.3f}")
    for each in results:
        failures = sum(not outcome.holds for outcome in each.outcomes)
        suite = ElementTree.SubElement(
            root,
            "testsuite",
            name=each.session,
            tests=str(max(len(each.outcomes), 1)),
            failures=str(failures),
            errors=str(int(bool(each.error))),
            time=f"{each.seconds:.3f}",
        )
        if each.error:
            case = ElementTree.SubElement(suite, "testcase", classname=each.session, name="session")
            ElementTree.SubElement(case, "error", message=each.error)
        for outcome in each.outcomes:
            case = ElementTree.SubElement(
                suite,
                "testcase",
                classname=each.session,
                name=outcome.expectation,
                time=f"{outcome.seconds:.3f}",
            )
            if not outcome.holds:
                ElementTree.SubElement(case, "failure", message=outcome.found)
    for element in root.iter():
        element.attrib = {key: _NOT_XML.sub("\ufffd", value) for key, value in element.attrib.items()}
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"
