"""Tests that apply to every scene."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from collision_monitor.errors import InputError
from collision_monitor.records import STATE
from collision_monitor.world import describe, make_scene, scene_names

RESPONDING = ("billiards", "slope", "pile", "pendulums")  # also in test_responding_scenes.py
SIMULATED = [name for name in scene_names() if name != "trajectory"]
RANDOM = [name for name in SIMULATED if name not in ("crossing", "arm", *RESPONDING)]


@pytest.mark.parametrize("name", scene_names())
def test_every_scene_has_one_line_for_people(name):
    assert describe(name)
    assert "\n" not in describe(name)


@pytest.mark.parametrize("call", [describe, make_scene])
def test_an_unknown_name_lists_the_scenes(call):
    with pytest.raises(InputError, match=r"fleet, particles, .*got 'warehouse'"):
        call("warehouse")


@pytest.mark.parametrize("name", SIMULATED)
def test_states_are_of_the_described_moving_objects_in_ascending_order(name):
    scene = make_scene(name)
    described = [d.object_id for d in scene.descriptions]
    assert len(set(described)) == len(described)
    assert len({d.name for d in scene.descriptions}) == len(described)
    states = scene.step()
    assert states.dtype == STATE
    assert states["id"].tolist() == [d.object_id for d in scene.descriptions if not d.static]
    assert np.linalg.norm(states["quaternion"], axis=1) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("name", SIMULATED)
def test_the_same_scene_gives_the_same_bits(name):
    first, second = make_scene(name), make_scene(name)
    for _ in range(50):
        assert first.step().tobytes() == second.step().tobytes()


@pytest.mark.parametrize("name", RANDOM)
def test_another_seed_gives_another_world(name):
    assert make_scene(name, seed=1).states().tobytes() != make_scene(name, seed=2).states().tobytes()


@pytest.mark.parametrize("name", RANDOM)
@pytest.mark.parametrize("objects", [2, 3, 17, 1000])
def test_scenes_have_as_many_moving_objects_as_asked_for(name, objects):
    assert len(make_scene(name, objects=objects).step()) == objects


@pytest.mark.parametrize("name", RANDOM)
@pytest.mark.parametrize("objects", [0, -1, 10**9, 2.5, True])
def test_impossible_counts_are_refused_with_the_range(name, objects):
    with pytest.raises(InputError, match=r"from [12] to 100000"):
        make_scene(name, objects=objects)


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), 1e9])
def test_impossible_rates_are_refused(rate):
    with pytest.raises(InputError, match="rate"):
        make_scene("fleet", rate=rate)


@pytest.mark.parametrize("seed", [-1, 1.5, True])
def test_impossible_seeds_are_refused(seed):
    with pytest.raises(InputError, match="seed"):
        make_scene("fleet", seed=seed)


@pytest.mark.parametrize("dt", [0.0, -0.1, float("nan"), float("inf"), 61.0])
def test_impossible_steps_are_refused(dt):
    with pytest.raises(InputError, match="step"):
        make_scene("crossing").step(dt)


def test_the_fixed_scene_takes_no_count():
    with pytest.raises(InputError, match="fixed set"):
        make_scene("crossing", objects=5)


def test_a_step_is_one_period_of_the_rate_unless_said_otherwise():
    scene = make_scene("clutter", rate=20.0)
    scene.step()
    scene.step(0.2)
    assert scene.time == pytest.approx(0.25)
    assert not scene.finished


@pytest.mark.parametrize("name", ["crossing", *RANDOM])  # the twists of the others always change
def test_twists_are_the_rates_of_change_of_the_poses(name):
    """Central differences over 1 ms of all objects that keep their twist in between."""
    dt, compared, all_ = 1e-3, 0, 0
    scene = make_scene(name) if name not in RANDOM else make_scene(name, objects=200)
    for _ in range(10):
        scene.step(0.37)
        before, now, after = scene.step(dt), scene.step(dt), scene.step(dt)
        jump = np.abs(after["linear"] - before["linear"]).max(axis=1) > 0.02
        jump |= np.abs(after["angular"] - before["angular"]).max(axis=1) > 0.0
        jump |= after["flags"] != 0
        linear = (after["position"] - before["position"]) / (2 * dt)
        turned = Rotation.from_quat(after["quaternion"]) * Rotation.from_quat(before["quaternion"]).inv()
        angular = turned.as_rotvec() / (2 * dt)
        assert linear[~jump] == pytest.approx(now["linear"][~jump], abs=1e-5)
        assert angular[~jump] == pytest.approx(now["angular"][~jump], abs=1e-5)
        compared, all_ = compared + np.count_nonzero(~jump), all_ + len(now)
    assert compared > 0.95 * all_


def test_measured_states_are_off_by_as_much_as_they_declare():
    """1 % for 3,000 objects along three axes; the true scene stays unchanged, and the noise is reproducible."""
    true, seen, again = (make_scene("clutter", objects=3000, noise=noise) for noise in (0.0, 0.01, 0.01))
    before = true.step(), seen.step(), again.step()
    assert before[1].tobytes() == before[2].tobytes() == seen.states().tobytes()
    turned = Rotation.from_quat(before[1]["quaternion"]) * Rotation.from_quat(before[0]["quaternion"]).inv()
    off = {name: before[1][name] - before[0][name] for name in ("position", "linear", "angular")}
    off["quaternion"] = turned.as_rotvec()
    for error in off.values():
        assert error.std() == pytest.approx(0.01, rel=0.03)
    for name in ("position", "orientation", "velocity", "angular_velocity"):
        assert (before[1][f"{name}_stddev"] == 0.01).all()
    assert not np.allclose(seen.step()["position"] - true.step()["position"], off["position"], atol=1e-3)


@pytest.mark.parametrize("noise", [-0.1, 2.0, float("nan")])
def test_impossible_noise_is_refused(noise):
    with pytest.raises(InputError, match="noise: expected more than 0"):
        make_scene("fleet", noise=noise)
