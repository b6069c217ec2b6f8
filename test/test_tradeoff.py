"""What the trade-off counts, on pairs whose answers are known beforehand, and its command."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from collision_monitor.cli.main import main
from collision_monitor.description import ObjectDescription
from collision_monitor.errors import InputError
from collision_monitor.geometry.shapes import Sphere
from collision_monitor.profiles import Profile
from collision_monitor.tradeoff import Step, tradeoff
from collision_monitor.world.scene import state_array

GOLDEN = Path(__file__).parent / "golden" / "balanced.mcap"
TWO = [ObjectDescription(1, Sphere(0.5)), ObjectDescription(2, Sphere(0.5))]


def passing(beside: float, steps: int = 20) -> list[Step]:
    """Sphere 2 passes sphere 1 at 1 m/s, `beside` metres off its middle."""
    found = []
    for k in range(steps):
        states = state_array(np.array([1, 2], np.uint32))
        states["position"][1] = (2.0 - 0.05 * k, beside, 0.0)
        states["linear"][1, 0] = -1.0
        found.append((k * 50_000_000, states))
    return found


def test_a_near_miss_is_a_false_alarm_of_the_coarse_profile_only() -> None:
    fast, exact = tradeoff("pass", TWO, passing(1.005), ["fast", "exact"])
    assert exact.alarms == exact.false_alarms == exact.misses == 0
    assert fast.false_alarms == fast.alarms == 20
    assert fast.misses == 0


def test_a_hit_is_seen_by_all_and_its_time_is_known_to_the_tolerance() -> None:
    fast, exact = tradeoff("hit", TWO, passing(0.0), ["fast", "exact"])
    for row in (fast, exact):
        assert (row.alarms, row.false_alarms, row.misses, row.outside_bound) == (20, 0, 0, 0)
    assert exact.ttc_error_s.worst < 1e-5
    tolerances = Profile.named("fast")
    allowed = 2 * (tolerances.position_tolerance + 2.0 * tolerances.velocity_tolerance) + tolerances.impact_tolerance
    assert exact.ttc_error_s.worst < fast.ttc_error_s.worst <= allowed


def test_progress_adds_up_and_empty_scenes_are_refused() -> None:
    done: list[int] = []
    tradeoff("hit", TWO, passing(0.0), ["fast", "balanced", "exact"], done.append)
    assert sum(done) == 2 * 3 * 20
    with pytest.raises(InputError, match="at least one step"):
        tradeoff("none", TWO, [], ["fast"])


def test_the_command_writes_what_it_prints(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table, picture = tmp_path / "rows.csv", tmp_path / "rows.png"
    arguments = ["--scene", "crossing", "--seconds", "0.5", "--json", "--csv", str(table), "--png", str(picture)]
    assert main(["tradeoff", *arguments]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    rows = json.loads(line)["rows"]
    assert [row["profile"] for row in rows] == ["fast", "balanced", "exact"]
    assert all(row["misses"] == 0 for row in rows)
    assert set(rows[0]["ttc_error_s"]) == {"median", "p99", "worst"}
    with table.open() as file:
        assert [row["profile"] for row in csv.DictReader(file)] == ["fast", "balanced", "exact"]
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_session_can_be_measured(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tradeoff", str(GOLDEN), "--profile", "balanced"]) == 0
    assert "balanced" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--scene", "rabbits"), "expected one of fleet"),
        (("--profile", "hasty"), "expected one of balanced, exact, fast"),
        ((str(GOLDEN), "--scene", "fleet"), "got both"),
        (("none.mcap",), "none.mcap"),
        (("--scene", "crossing", "--seconds", "0.1", "--csv", "/no/such/folder/rows.csv"), "can be written"),
    ],
    ids=["scene", "profile", "both", "session", "output"],
)
def test_bad_input_is_one_line(arguments: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tradeoff", *arguments]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and words in error
