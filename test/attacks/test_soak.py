"""The soak test: a short run agrees, and a monitor that differs is noticed."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from collision_monitor.shapes.registry import Sphere

ROOT = Path(__file__).parents[2]
SOAK = ROOT / "benchmarks" / "soak.py"


@pytest.fixture
def soak(monkeypatch: pytest.MonkeyPatch) -> object:
    monkeypatch.syspath_prepend(str(SOAK.parent))
    import soak

    return soak


def test_72_simulated_seconds_agree_with_plain_recomputation() -> None:
    run = subprocess.run(
        [sys.executable, str(SOAK), "--hours", "0.02", "--every", "12", "--json"],
        capture_output=True, text=True, timeout=300, cwd=ROOT,
    )  # fmt: skip
    assert run.returncode == 0, run.stdout + run.stderr
    report = json.loads(run.stdout)
    assert report["problems"] == []
    assert (report["steps"], report["compared"]) == (720, 60)
    assert report["silent_compared"] > 30
    assert min(report["came"], report["changed"], report["switched"]) > 0
    assert report["contacts"] > 100 and report["predictions"] > 100


def test_objects_that_are_smaller_in_one_of_both_monitors_are_a_problem(soak: object) -> None:
    run = soak.Soak(10, seed=1, every=10)  # type: ignore[attr-defined]
    for object_id in run.traffic.states["id"].tolist():
        run.plain.add(object_id, Sphere(0.01), replace=True)
    for number in range(300):
        run.step(number)
    assert any("touches in one answer only" in each or "never does" in each for each in run.report.problems)


def test_a_silent_object_that_is_forgotten_is_a_problem(soak: object) -> None:
    run = soak.Soak(40, seed=1, every=10)  # type: ignore[attr-defined]
    run.pipeline.monitor.profile = run.profile.replace(stale_acceleration=0.0, horizon=0.0)
    for number in range(300):
        run.traffic.silent_until[::2] = number + 6 if number % 10 == 0 else run.traffic.silent_until[::2]
        run.traffic.states["linear"][::2] += 0.4 * (-1.0) ** (number // 10)  # more than they may accelerate
        run.step(number)
    assert any("is not reported" in each for each in run.report.problems)
