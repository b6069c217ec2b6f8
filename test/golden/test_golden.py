"""Golden sessions replay to the same bytes, with one thread and with two."""

from __future__ import annotations

from pathlib import Path

import pytest
from started_threads import StartedThreads

from collision_monitor.session import Session
from collision_monitor.session.replaying.replay import replay

SESSIONS = sorted(Path(__file__).parent.glob("*.mcap"))


def test_there_are_golden_sessions() -> None:
    assert {path.stem for path in SESSIONS} == {"balanced", "exact"}


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("path", SESSIONS, ids=lambda path: path.stem)
def test_a_golden_session_replays_to_the_same_bytes(path: Path, threads: int, started_threads: StartedThreads) -> None:
    """The session may come from another build of the sources, so the test compares bytes and ignores provenance."""
    report = replay(Session(path), threads=threads)
    assert started_threads.most == (threads if threads > 1 else 0), "the number of threads is that of the test's name"
    assert report.first_difference is None, (
        f"{report.first_difference}. Where this change of answers is meant, run test/golden/make.py"
    )
    assert not report.hole
    assert report.steps == 300
    assert report.compared > 600
