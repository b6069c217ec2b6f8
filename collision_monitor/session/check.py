"""Checks many sessions at once: each for itself, on all cores, in the order they were named, whatever is broken."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from itertools import repeat
from multiprocessing import get_context
from pathlib import Path
from xml.etree import ElementTree

from collision_monitor.errors import CollisionMonitorError, InputError
from collision_monitor.profiles import Profile
from collision_monitor.session.expectations import Outcome, evaluate, load_expectations
from collision_monitor.session.history import read_history
from collision_monitor.session.reader import Session
from collision_monitor.session.replay import replay


@dataclass(frozen=True)
class Checked:
    """A session and its outcomes, or why it could not be read."""

    session: str
    outcomes: list[Outcome] = field(default_factory=list)
    error: str = ""

    @property
    def holds(self) -> bool:
        """Whether it was read and all expectations hold."""
        return not self.error and all(each.holds for each in self.outcomes)


def find_sessions(names: Iterable[str]) -> list[Path]:
    """Session files: files as they are named, wildcards, and all in the folders below. Raises InputError where none."""
    found: list[Path] = []
    for name in names:
        paths = sorted(glob.glob(name)) or [name]
        for path in map(Path, paths):
            if path.is_dir():
                inside = sorted(path.rglob("*.mcap"))
                if not inside:
                    raise InputError(f"{path}: expected a folder with .mcap files, got none")
                found += inside
            else:
                found.append(path)
    return list(dict.fromkeys(found))


def check_session(path: Path, expectations: Path, with_profile: str | None = None) -> Checked:
    """One session; with_profile: what today's program answers with that profile, or as recorded where it is empty."""
    expected = load_expectations(expectations)
    try:
        session = Session(path)
        profile = None
        if with_profile is not None:
            profile = Profile.named(with_profile) if with_profile else session.profile
        history = read_history(session, profile)

        return Checked(str(path), evaluate(expected, history, lambda: replay_verdict(path)))
    except CollisionMonitorError as error:
        return Checked(str(path), error=str(error))


def replay_verdict(path: Path) -> str:
    """What a replay comes to, in words: `identical`, or how it differs. Raises SessionError."""
    report = replay(Session(path))
    text = report.verdict.name.lower().replace("_", " ")
    return text if report.first_difference is None else f"{text}: {report.first_difference}"


def check_sessions(
    paths: Sequence[Path], expectations: Path, *, with_profile: str | None = None, jobs: int | None = None
) -> Iterator[Checked]:
    """The outcomes of each session, in order; jobs: processes, by default one for each core. Raises InputError."""
    load_expectations(expectations)
    jobs = min(jobs or os.cpu_count() or 1, len(paths))
    if jobs <= 1:
        yield from map(check_session, paths, repeat(expectations), repeat(with_profile))
        return
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from pool.map(check_session, paths, repeat(expectations), repeat(with_profile))


def junit_xml(results: Sequence[Checked]) -> str:
    """The results as JUnit XML: a suite for each session, a case for each expectation."""
    root = ElementTree.Element("testsuites", name="collision-monitor check")
    for each in results:
        failures = sum(not outcome.holds for outcome in each.outcomes)
        suite = ElementTree.SubElement(
            root,
            "testsuite",
            name=each.session,
            tests=str(max(len(each.outcomes), 1)),
            failures=str(failures),
            errors=str(int(bool(each.error))),
        )
        if each.error:
            case = ElementTree.SubElement(suite, "testcase", classname=each.session, name="session")
            ElementTree.SubElement(case, "error", message=each.error)
        for outcome in each.outcomes:
            case = ElementTree.SubElement(suite, "testcase", classname=each.session, name=outcome.expectation)
            if not outcome.holds:
                ElementTree.SubElement(case, "failure", message=outcome.found)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"
