"""A pytest plugin that provides recorded sessions as fixtures, so that a team can keep them as tests.

    @pytest.mark.session("yard.mcap")
    def test_yard(session):
        assert session.contacts("cart", "wall_*") == []
        assert all(each.lower > 0.5 for each in session.predictions("cart", "person_*"))
        session.check("expectations.yaml")

The path is relative to the test's file. `replay=True` and `replay="fast"` replace the recorded answers by those of this
program to the recorded inputs, with the recorded profile or with the named one.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest

from collision_monitor.errors import CollisionMonitorError

if TYPE_CHECKING:
    from collision_monitor.session.history.history import CollisionEvent, History

_MARKER = "session(path, replay=False): the recorded session that the fixture `session` reads"


class Prediction(NamedTuple):
    """A predicted collision of a pair.

    time: when it was predicted (s from the first step). lower, upper: bounds of the time from then to the contact (s).
    """

    pair: tuple[int, int]
    time: float
    lower: float
    upper: float


class RecordedSession:
    """A session under test."""

    def __init__(self, path: Path, replay: bool | str = False) -> None:
        from collision_monitor.session import Session
        from collision_monitor.session.history.read_history import AS_RECORDED, read_history

        self.path = path
        again = replay if isinstance(replay, str) else AS_RECORDED if replay else None
        self.history: History = read_history(Session(path), again)

    def contacts(self, a: str | int = "*", b: str | int = "*") -> list[CollisionEvent]:
        """Return the collisions between objects with these names or ids. Names may hold wildcards.

        Raises InputError for unknown ones.
        """
        return self.history.collisions_of([a, b])

    def predictions(self, a: str | int = "*", b: str | int = "*") -> list[Prediction]:
        """Return every prediction of a collision between them, in the order of prediction. Raises InputError."""
        wanted = self.history.pairs_of([a, b])
        rows = zip(self.history.prediction_step.tolist(), self.history.predictions, strict=True)
        return [
            Prediction(pair, float(self.history.times[step]), float(row["lower"]), float(row["upper"]))
            for step, row in rows
            if wanted(pair := (int(row["id_a"]), int(row["id_b"])))
        ]

    def replay(self) -> str:
        """Replay the session and return `identical`, `not comparable` or `diverged`, with the first difference."""
        from collision_monitor.session.history.check import replay_verdict

        return replay_verdict(self.path)

    def check(self, expectations: str | Path | dict[str, Any]) -> None:
        """Assert the expectations of a YAML file or of an equal mapping. A path is relative to the session's file."""
        from collision_monitor.session.history.expectations import (
            evaluate_expectations,
            parse_expectations,
            read_expectations,
        )

        if isinstance(expectations, dict):
            expected = parse_expectations(expectations)
        else:
            expected = parse_expectations(read_expectations(self.path.parent / expectations))
        failed = [each for each in evaluate_expectations(expected, self.history, self.replay) if not each.holds]
        assert not failed, "\n".join([str(self.path), *(f"  {each.expectation}: {each.found}" for each in failed)])


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker."""
    config.addinivalue_line("markers", _MARKER)


@pytest.fixture
def session(request: pytest.FixtureRequest) -> RecordedSession:
    """Return the recorded session that the test's marker names."""
    marker = request.node.get_closest_marker("session")
    if marker is None or len(marker.args) != 1 or set(marker.kwargs) - {"replay"}:
        pytest.fail(f'expected a marker such as @pytest.mark.session("yard.mcap"): {_MARKER}', pytrace=False)
    try:
        return RecordedSession(request.path.parent / marker.args[0], **marker.kwargs)
    except CollisionMonitorError as error:
        pytest.fail(str(error), pytrace=False)
