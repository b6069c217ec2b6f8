"""Tests of the numbers of the trade-off, on pairs with known answers, and of its command."""

from __future__ import annotations

import csv
import json
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from collision_monitor.accuracy.inputs import Workload
from collision_monitor.accuracy.playback import Step
from collision_monitor.accuracy.reference_monitor import ReferenceMonitor
from collision_monitor.accuracy.tradeoff.profile_tradeoff import profile_tradeoff
from collision_monitor.accuracy.tradeoff.tradeoff import tradeoff
from collision_monitor.cli.main import main
from collision_monitor.errors import InputError
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.records import PredictionStatus
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.registry import Sphere
from collision_monitor.world.scene import state_array

GOLDEN = Path(__file__).parents[2] / "golden" / "balanced.mcap"
TWO = [ObjectDescription(1, Sphere(0.5)), ObjectDescription(2, Sphere(0.5))]


def passing(beside: float, steps: int = 20) -> list[Step]:
    """Return steps in which sphere 2 passes sphere 1 at 1 m/s, at a distance of `beside` (m) from its centre."""
    found = []
    for k in range(steps):
        states = state_array(np.array([1, 2], np.uint32))
        states["position"][1] = (2.0 - 0.05 * k, beside, 0.0)
        states["linear"][1, 0] = -1.0
        found.append((k * 50_000_000, states))
    return found


def test_a_near_miss_is_a_false_alarm_of_the_coarse_profile_only() -> None:
    coarse = Profile.named("fast").replace(adaptive_tolerances=False)
    fast, exact = profile_tradeoff("pass", TWO, passing(1.005), [coarse, "exact"])
    assert exact.alarms == exact.beyond_exact == exact.misses == 0
    assert fast.beyond_exact == fast.alarms == 20
    assert fast.open_alarms == 20  # the scene ends before the horizon of any of them
    assert fast.misses == 0
    fast, _ = profile_tradeoff("pass", TWO, passing(1.005, 100), [coarse, "exact"])
    assert fast.false_alarms == fast.alarms > 20


def test_a_hit_is_seen_by_all_and_its_time_is_known_to_the_tolerance() -> None:
    fast, exact = profile_tradeoff("hit", TWO, passing(0.0), ["fast", "exact"])
    for row in (fast, exact):
        assert (row.alarms, row.beyond_exact, row.misses, row.outside_bound) == (20, 0, 0, 0)
    assert exact.ttc_error_s.worst < 1e-5
    tolerances = Profile.named("fast")
    allowed = 2 * (tolerances.position_tolerance + 2.0 * tolerances.velocity_tolerance) + tolerances.impact_tolerance
    assert exact.ttc_error_s.worst < fast.ttc_error_s.worst <= allowed


def test_what_may_happen_by_what_is_uncertain_is_no_alarm() -> None:
    """A near miss of states that declare 2 cm. `exact` reports the pair as POSSIBLE; the exact answers lack it."""
    steps = passing(1.005)
    for _, states in steps:
        states["position_stddev"] = 0.02
    monitor = Monitor("exact")
    for description in TWO:
        monitor.describe(description)
    found = [each["status"] for stamp, states in steps for each in monitor.step(stamp, states).predictions]
    assert found and set(found) == {PredictionStatus.POSSIBLE}
    (row,) = profile_tradeoff("pass", TWO, steps, ["exact"])
    assert (row.alarms, row.misses, row.compared) == (0, 0, 0) and np.isnan(row.within_bound)


def test_an_interval_beside_the_truth_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """The exact answers belong to slower motions of the same objects, so no interval contains the exact time."""
    right = ReferenceMonitor.step
    monkeypatch.setattr(ReferenceMonitor, "step", lambda self, stamp, states: right(self, stamp, _slower(states)))
    (row,) = profile_tradeoff("hit", TWO, passing(0.0, 5), ["exact"])
    assert (row.compared, row.outside_bound, row.within_bound) == (5, 5, 0.0)


def _slower(states: NDArray[np.void]) -> NDArray[np.void]:
    states = states.copy()
    states["linear"] *= 0.9
    return states


def test_the_fleet_as_a_localiser_sees_it_is_what_fast_is_for(capsys: pytest.CaptureFixture[str]) -> None:
    """The states declare 5 mm. `exact` recomputes the probability of each pair in each step; `fast` computes none."""
    assert main(["tradeoff", "--scene", "fleet", "--seconds", "0.3", "--json"]) == 0
    fast, _, exact = json.loads(capsys.readouterr().out)["rows"]
    assert fast["scene"] == "fleet" and fast["noise"] == 0.005
    assert fast["misses"] == fast["outside_bound"] == exact["misses"] == exact["outside_bound"] == 0
    assert 5.0 * fast["step_ms"] < exact["step_ms"]


def test_each_clip_of_recorded_tracks_is_a_scene(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for clip, label in (("there", 1), ("back", 2)):
        rows = [f"{label},{frame},p,{0.1 * frame},0,3,0" for frame in range(4)]
        (tmp_path / f"{clip}_ped.csv").write_text("\n".join(["id,frame,label,x_est,y_est,vx_est,vy_est", *rows]))
    arguments = ["--scene", "trajectory", "--path", str(tmp_path), "--profile", "fast", "--json"]
    assert main(["tradeoff", *arguments]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [(row["scene"], row["steps"]) for row in rows] == [("back", 4), ("there", 4)]


def test_progress_adds_up_and_empty_scenes_are_refused() -> None:
    done: list[int] = []
    profile_tradeoff("hit", TWO, passing(0.0), ["fast", "balanced", "exact"], done.append)
    assert sum(done) == 2 * 3 * 20
    with pytest.raises(InputError, match="at least one step"):
        profile_tradeoff("none", TWO, [], ["fast"])


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


def test_profiles_that_are_named_are_measured_on_the_scene_of_meshes_too() -> None:
    meshes = Workload("arm", TWO, passing(0.0))
    rows = tradeoff([meshes], [Profile.named("fast")], None, lambda name, total: nullcontext(lambda done: None))
    assert [row.profile for row in rows] == ["fast"] and rows[0].model == "exact"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--scene", "rabbits"), "expected one of fleet"),
        (("--profile", "hasty"), "expected one of balanced, exact, fast"),
        ((str(GOLDEN), "--scene", "fleet"), "got both"),
        (("none.mcap",), "none.mcap"),
        (("--profile", "fast", "--model", "obb"), "got both: --profile and --model"),
        ((str(GOLDEN), "--noise", "0.1"), "measured as it was recorded"),
        (("--scene", "fleet", "--noise", "2"), "noise: expected more than 0 and at most 1, got 2"),
        (("--scene", "trajectory"), "give a clip's prefix"),
        (("--scene", "crossing", "--seconds", "0.1", "--csv", "/no/such/folder/rows.csv"), "can be written"),
    ],
    ids=["scene", "profile", "both", "session", "models", "noise", "much", "tracks", "output"],
)
def test_bad_input_is_one_line(arguments: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tradeoff", *arguments]) == (1 if words in ("none.mcap", "can be written") else 2)
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and words in error
