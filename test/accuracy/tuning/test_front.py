"""Tests of the Pareto front of settings, its fixed part, and its picture."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from collision_monitor.accuracy.inputs import simulated
from collision_monitor.accuracy.tuning.front import Front, error_of, front_settings, measure_front
from collision_monitor.accuracy.tuning.front_picture import draw_fronts
from collision_monitor.cli.main import main


@pytest.fixture(scope="module")
def front() -> Front:
    (work,) = simulated(["clutter"], objects=30, noise=0.005, duration=1.0)
    settings = front_settings(work)
    done: list[int] = []
    found = measure_front(work, settings, done.append)
    assert sum(done) == len(settings) + 2
    return found


def test_no_setting_beats_one_of_the_front_and_none_misses_a_collision(front: Front) -> None:
    assert len(front.rows) >= 12
    for which in ("time", "distance"):
        best = front.best(which)
        for row in front.rows:
            value = error_of(row, which)
            assert value != value or any(b.step_ms <= row.step_ms and error_of(b, which) <= value for b in best)
        errors = [error_of(row, which) for row in best]
        assert errors == sorted(set(errors), reverse=True)
    assert all(row.misses == row.outside_bound == 0 for row in front.rows)


def test_the_fixed_part_is_less_than_any_step_with_pairs(front: Front) -> None:
    assert front.fixed_us > 0.0
    assert "µs are fixed" in front.summary() and front.summary().startswith("clutter ± 0.005: ")


def test_the_command_draws_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "front.png"
    arguments = ["tradeoff", "--scene", "crossing", "--seconds", "0.4", "--front"]
    assert main([*arguments, "--json", "--png", str(picture)]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {row["profile"] for row in found["rows"]} >= {"fast", "balanced", "exact", "balanced × 10"}
    assert set(found["front"]["crossing"]) == {"time", "distance"} and found["fixed_us"]["crossing"] > 0.0
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert main([*arguments, "--model", "obb"]) == 2
    assert "goes without" in capsys.readouterr().err


def test_the_legend_lists_the_marks_that_are_drawn(
    tmp_path: Path, front: Front, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[list[str]] = []
    monkeypatch.setattr(Figure, "legend", lambda _, handles, **__: shown.append([str(h.get_label()) for h in handles]))
    some = Front([row for row in front.rows if row.profile != "balanced"], front.fixed_us)
    for chosen in (None, some.rows[-1].profile):
        draw_fronts({"clutter": [some]}, tmp_path / "front.png", chosen=chosen)
    usual = [row.profile for row in some.rows if row.profile in ("fast", "exact")]
    assert shown[0] == ["front, states ± 0.005", *usual]
    assert shown[1] == list(dict.fromkeys([*shown[0], some.rows[-1].profile]))


def test_a_table_of_profiles_ends_with_what_there_is_to_trade(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tradeoff", "--scene", "crossing", "--seconds", "0.4", "--profile", "fast", "--profile", "exact"]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("crossing: ") and "to trade" in last and "µs are fixed" in last
