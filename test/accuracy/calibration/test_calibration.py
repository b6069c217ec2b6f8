"""Calibration on recordings whose motions and errors are known."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from played_session import record_states

from collision_monitor.accuracy.calibration.calibration import RADII, calibrate, class_of
from collision_monitor.accuracy.calibration.error_growth import ErrorGrowth, fitted_growth
from collision_monitor.cli.main import main
from collision_monitor.errors import InputError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.records import STATE, StateFlag
from collision_monitor.session import Session
from collision_monitor.session.history.read_history import read_history
from collision_monitor.shapes.registry import Sphere

NOISE = 0.2  # m/s along each axis
RATE = 10


def arcs(time: float, count: int) -> Any:
    """Vehicles on circles that brake and speed up a little, with exact states."""
    rows = np.zeros(count, STATE)
    k = np.arange(count)
    turn, radius = 0.4 + 0.05 * k, 6.0 + k
    angle = turn * time
    rows["id"] = 1 + k
    rows["position"][:, 0], rows["position"][:, 1] = 100.0 * k + radius * np.sin(angle), -radius * np.cos(angle)
    rows["quaternion"][:, 2], rows["quaternion"][:, 3] = np.sin(angle / 2), np.cos(angle / 2)
    rows["linear"][:, 0], rows["linear"][:, 1] = radius * turn * np.cos(angle), radius * turn * np.sin(angle)
    rows["angular"][:, 2] = turn
    rows["acceleration"][:, 0] = -radius * turn**2 * np.sin(angle)
    rows["acceleration"][:, 1] = radius * turn**2 * np.cos(angle)
    rows["flags"] = StateFlag.ACCELERATION_VALID
    return rows


def walkers(time: float, count: int, rng: np.random.Generator) -> Any:
    """People at 1 m/s whose stated velocities and accelerations are noisy, and whose positions are exact."""
    rows = np.zeros(count, STATE)
    k = np.arange(count)
    rows["id"] = 100 + k
    rows["position"][:, 0], rows["position"][:, 1] = time, -50.0 - 3.0 * k
    rows["quaternion"][:, 3] = 1.0
    rows["linear"][:, 0] = 1.0
    rows["linear"][:, :2] += rng.normal(0, NOISE, (count, 2))
    rows["acceleration"][:, :2] = rng.normal(0, 1.0, (count, 2))
    rows["flags"] = StateFlag.ACCELERATION_VALID
    return rows


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory) -> Path:
    rng = np.random.default_rng(1)
    described = [ObjectDescription(1 + k, Sphere(0.5), name=f"car_{k}") for k in range(3)]
    described += [ObjectDescription(100 + k, Sphere(0.3), name=f"person_{k}") for k in range(4)]
    played = ((k / RATE, np.concatenate([arcs(k / RATE, 3), walkers(k / RATE, 4, rng)])) for k in range(300))
    return record_states(tmp_path_factory.mktemp("street") / "street.mcap", described, played, answers=False)


def test_each_class_gets_the_model_that_made_it(street: Path) -> None:
    car, person = calibrate(read_history(Session(street)))
    assert (car.name, car.objects, car.axes) == ("car", 3, 2)
    assert (car.chosen.candidate.motion, person.chosen.candidate.motion) == ("arc", "people")
    assert max(car.chosen.held_out) < 0.05  # the true position lies on the chord between two states
    straight = next(each for each in car.models if each.candidate.motion == "people")
    assert straight.held_out[-1] > 1.0


def test_the_standard_deviations_are_those_of_the_noise_and_hold_in_the_second_half(street: Path) -> None:
    _, person = calibrate(read_history(Session(street)))
    assert person.growth.velocity == pytest.approx(NOISE, rel=0.1)
    assert person.growth.position < 0.01 and person.growth.acceleration < 0.1
    for lead, rms in zip((0.5, 1.0, 2.0), person.chosen.held_out, strict=True):
        assert rms == pytest.approx(NOISE * lead * 2**0.5, rel=0.1)
    assert all(part == pytest.approx(0.95, abs=0.03) for part in person.within)


@given(st.tuples(*[st.floats(0.01, 2.0)] * 3))
def test_the_growth_is_found_again_from_its_variances(given_growth: tuple[float, float, float]) -> None:
    growth = ErrorGrowth(*given_growth)
    leads = (0.1, 0.25, 0.5, 1.0, 2.0)
    found = fitted_growth(leads, [growth.after(t) ** 2 for t in leads])
    for t in leads:
        assert found.after(t) == pytest.approx(growth.after(t), rel=1e-6)


@pytest.mark.parametrize("axes", [2, 3])
def test_the_radii_hold_95_percent_of_a_normal_distribution(axes: int) -> None:
    off = np.linalg.norm(np.random.default_rng(2).normal(size=(200_000, axes)), axis=1)
    assert (off <= RADII[axes]).mean() == pytest.approx(0.95, abs=0.002)


@pytest.mark.parametrize(("name", "expected"), [("car_12", "car"), ("cart", "cart"), ("agv 3", "agv"), ("7", "7")])
def test_a_class_is_a_name_without_its_number(name: str, expected: str) -> None:
    assert class_of(name) == expected


def test_the_command_prints_models_and_settings_and_draws(
    street: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["calibrate", str(street), "--png", str(tmp_path / "errors.png")]) == 0
    text = capsys.readouterr().out
    assert "person: 4 objects, 1200 states" in text and "chosen" in text
    assert "person: {motion: people, position_stddev: " in text and "car: {motion: arc" in text
    assert (tmp_path / "errors.png").read_bytes()[:4] == b"\x89PNG"
    assert main(["calibrate", str(street), "--png", str(tmp_path / "errors.png")]) != 0  # it is there
    capsys.readouterr()
    assert main(["calibrate", str(street), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [(each["class"], each["motion"]) for each in found] == [("car", "arc"), ("person", "people")]


def test_a_recording_that_is_too_short_is_refused(tmp_path: Path) -> None:
    described = [ObjectDescription(1, Sphere(0.5), name="car_1")]
    path = record_states(tmp_path / "short.mcap", described, ((k / RATE, arcs(k / RATE, 1)) for k in range(20)))
    with pytest.raises(InputError, match="expected a class of moving objects with 20 predictions over 2 s"):
        calibrate(read_history(Session(path)))
    assert main(["calibrate", str(path)]) == 1
