"""Calibration against simulated objects whose motions and errors are known."""

from __future__ import annotations

import doctest
import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from session_scene import record

from collision_monitor import Sphere
from collision_monitor.accuracy.calibration import deviation
from collision_monitor.accuracy.calibration.calibrate import Calibration, calibrate
from collision_monitor.accuracy.calibration.deviation import LAGS, Growth, growth_of
from collision_monitor.accuracy.calibration.predictors import Predictor
from collision_monitor.accuracy.calibration.tracks import class_of, tracks_by_class
from collision_monitor.accuracy.inputs import Workload
from collision_monitor.cli.main import main
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.records import STATE, StateFlag
from collision_monitor.world.recorded_tracks import FRAME_RATE

RATE = 20.0
SECONDS = 12.0
Array = NDArray[np.float64]


def workload(tracks: dict[str, NDArray[np.void]], jumps: float = np.inf) -> Workload:
    """Steps at RATE in which each object has one state; tracks: of each name, states (K,)."""
    ids = {name: k + 1 for k, name in enumerate(tracks)}
    count = len(next(iter(tracks.values())))
    steps = []
    for k in range(count):
        rows = np.concatenate([rows[k : k + 1] for rows in tracks.values()])
        rows["id"] = list(ids.values())
        steps.append((round(k / RATE * 1e9), rows))
    return Workload("made", [ObjectDescription(i, Sphere(0.3), name) for name, i in ids.items()], steps)


def states(t: Array, position: Array, linear: Array, heading: Array, rate: float) -> NDArray[np.void]:
    rows = np.zeros(len(t), STATE)
    rows["position"][:, :2], rows["linear"][:, :2] = position, linear
    rows["quaternion"][:, 2], rows["quaternion"][:, 3] = np.sin(heading / 2), np.cos(heading / 2)
    rows["angular"][:, 2] = rate
    return rows


def on_a_circle(rng: np.random.Generator) -> NDArray[np.void]:
    t = np.arange(0.0, SECONDS, 1 / RATE)
    speed, rate = rng.uniform(0.5, 1.5), rng.choice((-1, 1)) * rng.uniform(0.4, 0.9)
    heading = rng.uniform(-3, 3) + rate * t
    forward = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    return states(t, -left * speed / rate, speed * forward, heading, rate)


def one(found: tuple[list[Calibration], list[str]]) -> Calibration:
    assert len(found[0]) == 1 and not found[1], found[1]
    return found[0][0]


def test_robots_in_bends_are_on_arcs_and_where_the_arcs_end() -> None:
    rng = np.random.default_rng(1)
    work = workload({f"agv_{k}": on_a_circle(rng) for k in range(6)})
    found = one(calibrate(tracks_by_class([work])))
    assert (found.name, found.tracks, found.chosen) == ("agv", 6, Predictor("arc"))
    assert found.rms[Predictor("arc")].max() < 2e-3  # between two states it is on the chord
    speed, rate = np.hypot(*work.steps[0][1]["linear"][:, :2].T), np.abs(work.steps[0][1]["angular"][:, 2])
    for lag, rms in zip(LAGS, found.rms[Predictor("people")], strict=True):  # how far a circle is off its tangent
        end = np.stack([np.sin(rate * lag), 1.0 - np.cos(rate * lag)], axis=1) * (speed / rate)[:, None]
        off = end - np.stack([speed * lag, 0.0 * speed], axis=1)
        assert rms == pytest.approx(np.sqrt((off**2).sum(axis=1).mean()), rel=0.02, abs=2e-3)


def test_deviations_of_known_errors_come_out_and_cover_what_they_promise() -> None:
    """Each object has one error of its velocity and one constant acceleration, and every state has an own error."""
    rng = np.random.default_rng(2)
    sigma, wrong, bend = 0.03, 0.2, 0.3
    t = np.arange(0.0, SECONDS, 1 / RATE)
    tracks = {}
    for k in range(120):
        velocity, a = rng.normal(size=2), bend * rng.normal(size=2)
        position = velocity * t[:, None] + a * t[:, None] ** 2 / 2
        seen = position + sigma / np.sqrt(2) * rng.normal(size=position.shape)
        stated = velocity + a * t[:, None] + wrong * rng.normal(size=position.shape)
        tracks[f"person_{k}"] = states(t, seen, stated, np.zeros(len(t)), 0.0)
        tracks[f"person_{k}"]["velocity_stddev"] = 0.05
    work = workload(tracks)
    found = one(calibrate(tracks_by_class([work])))
    stated = growth_of(found.rms[Predictor("people")] ** 2 / 2.0, np.array(LAGS))
    assert stated.position == pytest.approx(sigma, rel=0.25)
    assert stated.velocity == pytest.approx(wrong, rel=0.1)
    assert stated.acceleration == pytest.approx(bend, rel=0.1)
    assert found.chosen.window > 0.0  # the velocities from the positions are better than these
    assert found.stated == (0.0, 0.05)
    for each in found.coverage.values():
        assert each.one == pytest.approx(0.68, abs=0.06) and each.two == pytest.approx(0.95, abs=0.03)


def test_a_car_that_brakes_and_stands_is_stopping() -> None:
    rng = np.random.default_rng(3)
    t = np.arange(0.0, SECONDS, 1 / RATE)
    tracks = {}
    for k in range(8):
        speed, brakes = rng.uniform(1.5, 3.0), rng.uniform(0.8, 2.0)
        rest = speed / brakes
        on = np.minimum(t, rest)
        rows = states(t, np.stack([speed * on - brakes * on**2 / 2, 0 * t], axis=1), np.stack(
            [speed - brakes * on, 0 * t], axis=1), 0 * t, 0.0)  # fmt: skip
        rows["acceleration"][t < rest, 0] = -brakes
        rows["flags"] |= np.uint32(StateFlag.ACCELERATION_VALID)
        tracks[f"car {k}"] = rows
    found = one(calibrate(tracks_by_class([workload(tracks)])))
    assert (found.name, found.chosen.motion) == ("car", "stops")
    assert found.rms[Predictor("straight")][-1] > 20 * found.rms[Predictor("stops")][-1]


def test_a_jump_is_no_motion_and_gaps_are_not_filled() -> None:
    t = np.arange(0.0, SECONDS, 1 / RATE)
    rows = states(t, np.stack([t, 0 * t], axis=1), np.tile((1.0, 0.0), (len(t), 1)), 0 * t, 0.0)
    rows["position"][120:, 0] += 50.0
    rows["flags"][120] = StateFlag.DISCONTINUITY
    found = one(calibrate(tracks_by_class([workload({"agv": rows})])))
    assert found.rms[Predictor("people")].max() < 1e-9
    sparse = Workload("gaps", [ObjectDescription(1, Sphere(0.3), "agv")], [
        (round(k / RATE * 1e9), rows[k : k + 1].copy()) for k in range(0, len(rows), 30)])  # fmt: skip
    for _, each in sparse.steps:
        each["id"] = 1
    found, left_out = calibrate(tracks_by_class([sparse]))
    assert not found and "agv: expected at least 30 states in each half" in left_out[0]


def test_classes_by_names_and_by_patterns() -> None:
    names = ("person_12", "clip/person_3", "car 7", "agv-03", "6ec0b7aa-01f2", "robot", "track#9")
    classes = ["person", "person", "car", "agv", "6ec0b7aa-01f2", "robot", "track"]
    assert [class_of(name, ()) for name in names] == classes
    assert [class_of(name, ("*person*", "car*")) for name in names[:4]] == ["*person*", "*person*", "car*", None]


def test_growth_is_the_least_squares_fit() -> None:
    assert not doctest.testmod(deviation).failed
    true, lags = Growth(0.02, 0.3, 0.5), np.array(LAGS)
    found = growth_of(np.array([true.at(lag) ** 2 for lag in LAGS]), lags)
    assert found == pytest.approx(true, rel=1e-6)
    assert growth_of(np.zeros(5), lags) == (0.0, 0.0, 0.0)


def clip(folder: Path) -> Path:
    """Three people who walk past each other, in the format of CITR."""
    rng = np.random.default_rng(5)
    lines = ["id,frame,label,x_est,y_est,vx_est,vy_est"]
    for person in (1, 2, 3):
        v = rng.normal(size=2)
        for frame in range(240):
            x, y = v * frame / FRAME_RATE + 0.01 * rng.normal(size=2)
            lines.append(f"{person},{frame},ped,{x:.6f},{y:.6f},{v[0]:.6f},{v[1]:.6f}")
    path = folder / "walk_ped.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_the_command_prints_settings_json_and_a_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, picture = clip(tmp_path), tmp_path / "motion.png"
    assert main(["calibrate", str(path), "--png", str(picture)]) == 0
    text = capsys.readouterr().out
    assert "person: 3 tracks" in text and "motion: people" in text and "3 tracks are few" in text
    assert all(len(line) <= 80 for line in text.splitlines())
    assert picture.read_bytes()[:4] == b"\x89PNG"
    assert main(["calibrate", str(path), "--json", "--class", "person_[12]", "--class", "person_*"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert [(each["class"], each["tracks"]) for each in answer["classes"]] == [("person_*", 1), ("person_[12]", 2)]
    assert main(["calibrate", str(path), "--class", "cart*"]) == 2
    assert "expected a pattern of names of objects that move, got 'cart*'" in capsys.readouterr().err


def test_a_session_is_read_and_one_that_says_nothing_is_named(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["calibrate", str(recorded)]) == 4  # 2.5 s of balls that bounce: too short
    shown = capsys.readouterr()
    assert not shown.out and "not calibrated: body: expected at least 30 states" in shown.err
    record(tmp_path / "long.mcap", 200)
    assert main(["calibrate", str(tmp_path / "long.mcap")]) == 0
    assert "body: 6 tracks, 1200 states" in capsys.readouterr().out
    assert main(["calibrate", "nothing.mcap"]) == 1
    assert "nothing.mcap" in capsys.readouterr().err
