"""Tests of `collision-monitor bench`: its numbers, formats and errors."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from collision_monitor._version import VERSION
from collision_monitor.accuracy import collision_rate
from collision_monitor.cli.main import main
from collision_monitor.detection.partitioned import BROAD_PHASES
from collision_monitor.errors import InputError
from collision_monitor.world.moving_bodies import BENCHMARK_SCENES, load_moving_bodies, make_moving_bodies

KEYS = {"scene", "n", "seed", "threads", "frames", "median_ms", "p99_ms", "min_ms", "pairs", "version"}


@pytest.mark.parametrize("scene", BENCHMARK_SCENES)
def test_json_is_one_line_with_everything(scene: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--scene", scene, "--n", "200", "--seed", "3", "--threads", "1", "--json"]) == 0
    out = capsys.readouterr().out
    assert out.count("\n") == 1
    result = json.loads(out)
    assert result.keys() == KEYS
    assert (result["scene"], result["n"], result["seed"], result["threads"]) == (scene, 200, 3, 1)
    assert (result["frames"], result["version"]) == (10, VERSION)
    assert 0 < result["min_ms"] <= result["median_ms"] <= result["p99_ms"]
    assert 20 <= result["pairs"] <= 80  # about a quarter of the objects, less at the open boundary


def test_hard_spheres_report_their_rate_energy_and_pressure(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(collision_rate, "COLLISIONS", 200_000)
    assert main(["bench", "--scene", "hard-spheres", "--n", "500", "--packing", "0.25", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["scene"], result["n"], result["packing"]) == ("hard-spheres", 500, 0.25)
    assert result["best_collisions_per_s"] >= result["collisions_per_s"] > 0
    assert abs(result["energy_drift"]) < 1e-12 and abs(result["momentum_drift"]) < 1e-12
    assert result["compressibility"] == pytest.approx(result["carnahan_starling"], rel=0.03)
    assert result["pressure"] == pytest.approx(6 * 0.25 / math.pi * result["compressibility"], rel=1e-9)
    assert main(["bench", "--scene", "hard_spheres", "--n", "100", "--packing", "0.1"]) == 0
    assert "collisions per second" in capsys.readouterr().out


def test_a_line_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--n", "50", "--threads", "1", "--frames", "5"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("boxes, 50 objects, 1 thread: ")
    assert "over 3 frames" in out and "colliding pairs" in out


@pytest.mark.parametrize("scene", BENCHMARK_SCENES)
def test_a_saved_scene_gives_the_same_pairs(scene: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "scene.npz"
    made = make_moving_bodies(scene, 150, seed=2)
    made.save(file)
    loaded = load_moving_bodies(file)
    assert np.array_equal(loaded.positions, made.positions) and np.array_equal(loaded.quaternions, made.quaternions)
    assert [repr(shape) for shape in loaded.shapes] == [repr(shape) for shape in made.shapes]
    main(["bench", "--scene-file", str(file), "--threads", "1", "--json"])
    main(["bench", "--scene", scene, "--n", "150", "--seed", "2", "--threads", "1", "--json"])
    first, second = (json.loads(line) for line in capsys.readouterr().out.splitlines())
    assert first["pairs"] == second["pairs"] and first["scene"] == scene


def test_the_density_does_not_depend_on_the_number() -> None:
    for scene in BENCHMARK_SCENES:
        few, many = (make_moving_bodies(scene, n).arrays["rho"] for n in (500, 4000))
        assert few == pytest.approx(many, rel=0.15)


def test_bad_arguments_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = tmp_path / "text.npz"
    text.write_text("no scene")
    other = tmp_path / "other.npz"
    np.savez(other, kind=np.zeros(3, np.uint8), size=np.ones((3, 3)), pos=np.zeros((2, 4, 3)), quat=np.zeros((2, 3, 4)))
    partial = tmp_path / "partial.npz"
    np.savez(partial, kind=np.zeros(3, np.uint8))
    for arguments, expected in (
        (["--scene", "rabbits"], "scene: expected one of boxes, spheres, mixed, hulls, hard-spheres"),
        (["--packing", "0.3"], "--packing: expected the scene hard-spheres"),
        (["--scene", "hard-spheres", "--threads", "2"], "--threads: expected no value"),
        (["--scene", "hard-spheres", "--n", "10"], "reflecting walls"),
        (["--n", "5", "--threads", "1000"], "threads: expected 1 to"),
        (["--scene-file", str(tmp_path / "none.npz")], "none.npz: expected a scene"),
        (["--scene-file", str(text)], "text.npz: expected a scene"),
        (["--scene-file", str(other)], "3 bodies do not go with size"),
        (["--scene-file", str(partial)], "no entry 'size'"),
    ):
        assert main(["bench", *arguments]) == (1 if "--scene-file" in arguments else 2)
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and expected in error


def test_scenes_are_refused_by_name() -> None:
    with pytest.raises(InputError, match="expected one of boxes"):
        make_moving_bodies("box", 10)


def test_broad_phases_are_compared_and_find_the_same_pairs(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--n", "200", "--frames", "3", "--broad-phase", "all", "--json"]) == 0
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [row["broad_phase"] for row in rows] == list(BROAD_PHASES)
    assert len({row["pairs"] for row in rows}) == 1
    assert main(["bench", "--n", "50", "--frames", "3", "--broad-phase", "k-d-tree"]) == 0
    assert ", k-d-tree: " in capsys.readouterr().out
    assert main(["bench", "--n", "50", "--broad-phase", "magic"]) == 2
    error = capsys.readouterr().err
    assert "--broad-phase: expected one of grid" in error and ", all, got 'magic'" in error
