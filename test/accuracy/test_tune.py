"""Tests of tuning: the cheapest settings that meet the demands, their parameter file, and the failed demands."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from collision_monitor.accuracy.inputs import recorded
from collision_monitor.accuracy.measurement import Errors
from collision_monitor.accuracy.tune import FACTORS, Demands, candidates, parameter_file, tune
from collision_monitor.cli.main import main
from collision_monitor.cli.parameter_file import check_parameter_file
from collision_monitor.errors import InputError
from collision_monitor.settings.profile import Profile

GOLDEN = Path(__file__).parents[1] / "golden" / "balanced.mcap"
PROGRAM = Path(sys.executable).with_name("collision-monitor")


@pytest.fixture(scope="module")
def trials():
    name, descriptions, steps, _ = recorded(GOLDEN)
    told = []
    chosen, trials = tune(name, descriptions, steps[:80], Demands(ttc_error=0.01), progress=told.append)
    assert sum(told) == 2 * 80 * len(trials)
    return chosen, trials


def test_tighter_profiles_err_less_and_the_chosen_one_little_enough(trials) -> None:
    chosen, found = trials
    assert [each.profile.name for each in found] == ["fast", *(f"balanced × {factor:g}" for factor in FACTORS), "exact"]
    errors = [each.measurement.ttc_error_s.p99 for each in found]
    assert errors[0] > 0.01 > errors[-1]
    assert all(bool(each.failures) == (each.measurement.ttc_error_s.p99 > 0.01) for each in found)
    taken = next(each for each in found if each.profile is chosen)
    assert not taken.failures
    assert taken.measurement.step_ms <= 1.05 * min(each.measurement.step_ms for each in found if not each.failures)


def test_each_demand_fails_with_its_measure(trials) -> None:
    row = replace(
        trials[1][0].measurement,
        misses=0,
        outside_bound=0,
        distance_error_m=0.5,
        ttc_error_s=Errors(0.1, 0.2, 0.3),
        step_ms_p99=8.0,
    )
    assert Demands().failures(row) == []
    assert Demands(0.1, 0.1, 4.0).failures(row) == [
        "distance error 0.5 m, 5 times the 0.1 m allowed",
        "TTC error 0.2 s, 2 times the 0.1 s allowed",
        "step time 8 ms, 2 times the 4 ms allowed",
    ]
    assert Demands().failures(replace(row, misses=2)) == ["2 collisions missed"]
    none = replace(row, distance_error_m=float("nan"))
    assert Demands(distance_error=0.1).failures(none) == []


def test_the_file_makes_the_profile_again(tmp_path: Path) -> None:
    for profile in candidates(1.5, 0.1):
        text = parameter_file(profile, ["two", "lines"])
        assert text.startswith("# two\n# lines\n")
        (tmp_path / "tuned.yaml").write_text(text)
        check_parameter_file(tmp_path / "tuned.yaml")
        settings = yaml.safe_load(text)["/**/object_monitor"]["ros__parameters"]
        again = Profile.named(settings.pop("profile")).replace(**settings)
        assert again.replace(name=profile.name) == profile


def test_a_demand_of_nothing_is_refused() -> None:
    with pytest.raises(InputError, match="budget_ms: expected a number above 0, got 0"):
        tune("none", [], [], Demands(budget_ms=0.0))


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)

    def run(*arguments: object) -> tuple[int, str, str]:
        code = main(["tune", str(GOLDEN), *map(str, arguments)])
        return code, *capsys.readouterr()

    command = [PROGRAM, "tune", GOLDEN, "--max-ttc-error", "0.05", "--png", "tried.png"]
    good = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert good.returncode == 0, good.stderr
    assert "→ " in good.stdout and "written balanced.yaml" in good.stdout
    check_parameter_file(tmp_path / "balanced.yaml")
    assert (tmp_path / "tried.png").read_bytes().startswith(b"\x89PNG")
    code, _, told = run("--max-ttc-error", 0.05)
    assert code == 1 and "--force" in told
    code, out, _ = run("--budget-ms", 1e-6, "--json", "-o", "none.yaml")
    assert code == 3
    answer = json.loads(out)
    assert answer["chosen"] is None
    assert all("step time" in each["failures"][-1] for each in answer["rows"])
    assert not (tmp_path / "none.yaml").exists()
    with pytest.raises(SystemExit) as wrong:
        run("--budget-ms", 0)
    assert wrong.value.code == 2
