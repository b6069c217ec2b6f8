"""Tests of the particle box: conservation, walls, grazing contacts, and steps against a plain simulation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_spheres import simulate

from collision_monitor.world.particles import Particles


def two_particles(rate, position, velocity):
    """Two equal particles of 0.1 m in the scene's box, 1.6 m wide."""
    scene = Particles(2, 1, rate)
    scene.radius[:], scene.mass[:] = 0.1, 1.0
    scene.position, scene.velocity = np.array(position, float), np.array(velocity, float)
    return scene


def test_nobody_overlaps_at_the_start():
    scene = Particles(500, 3, None)
    a, b = np.triu_indices(500, 1)
    distance = np.linalg.norm(scene.position[a] - scene.position[b], axis=1)
    assert (distance > scene.radius[a] + scene.radius[b]).all()


def test_energy_is_conserved_and_everyone_stays_in_the_box_for_a_minute():
    scene = Particles(100, 1, None)
    energy, start = scene.energy, scene.velocity.copy()
    for _ in range(int(60 * scene.rate)):
        scene.step()
        assert (scene.position >= scene.radius[:, None]).all()
        assert (scene.position <= scene.size - scene.radius[:, None]).all()
    assert scene.energy == pytest.approx(energy, rel=1e-12)
    speeds = np.linalg.norm(scene.velocity, axis=1), np.linalg.norm(start, axis=1)
    assert (np.abs(speeds[0] - speeds[1]) > 1e-6).all()  # walls keep speeds, so every particle has met another


def test_restitution_below_one_only_loses_energy():
    scene = Particles(60, 1, None, restitution=0.8)
    last = first = scene.energy
    for _ in range(1000):
        scene.step()
        assert scene.energy <= last * (1 + 1e-12)
        last = scene.energy
    assert last < 0.5 * first


def test_two_equal_particles_swap_their_velocities_away_from_walls():
    scene = two_particles(None, [[0.4, 0.8, 0.8], [1.2, 0.8, 0.8]], [[1.0, 0, 0], [-1.0, 0, 0]])
    for _ in range(50):
        scene.step()
    assert scene.velocity == pytest.approx(np.array([[-1.0, 0, 0], [1.0, 0, 0]]), abs=1e-15)


def test_a_long_step_steps_over_no_collision():
    scene = two_particles(None, [[0.2, 0.8, 0.8], [1.4, 0.8, 0.8]], [[1.0, 0, 0], [-1.0, 0, 0]])
    scene.step(1.0)
    assert scene.velocity[:, 0] == pytest.approx([-1.0, 1.0], abs=1e-15)


@pytest.mark.parametrize("rate", [10.0, 100.0, 1000.0])
@pytest.mark.parametrize("phase", np.linspace(0.0, 1.0, 6, endpoint=False))
def test_grazing_spheres_do_not_pass_through_each_other(rate, phase):
    """Offset 0.199 m for radii of 0.1 m, at 3 m/s: they overlap for 13 ms, at any part of a step."""
    scene = two_particles(rate, [[0.4 + phase * 3.0 / rate, 0.8, 0.8], [1.0, 0.999, 0.8]], [[3.0, 0, 0], [0, 0, 0]])
    while scene.time < 0.4:
        scene.step()
    assert scene.velocity[1] @ scene.velocity[1] > 1e-3


def test_the_step_does_not_change_the_result():
    """Until chaos has multiplied the round-off: about 10 collisions of each particle."""
    ends = []
    for steps in (1, 7, 64):
        scene = Particles(60, 1, None, restitution=0.9)
        for _ in range(steps):
            scene.step(2.0 / steps)
        ends.append(scene.position)
    assert ends[1] == pytest.approx(ends[0], abs=1e-7)
    assert ends[2] == pytest.approx(ends[0], abs=1e-7)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_a_step_is_that_of_a_plain_simulation(seed):
    random = np.random.default_rng(seed)
    scene = Particles(8, seed, None, restitution=0.8)
    scene.mass = (2 * scene.radius) ** 3
    scene.velocity *= random.uniform(1, 10)
    expected = simulate(
        scene.position, scene.velocity, scene.radius, scene.size, periodic=False, restitution=0.8, collisions=12
    )
    before = scene.velocity
    for time, a, b in expected:  # a step ends between two collisions; the next has changed one velocity or two
        scene.step(time + 1e-9 - scene.time)
        changed = np.flatnonzero((scene.velocity != before).any(axis=1)).tolist()
        assert changed == ([a] if b < 0 else [a, b])
        before = scene.velocity


def test_no_overlap_remains_after_a_step():
    scene = Particles(300, 2, None, restitution=0.7)
    a, b = np.triu_indices(300, 1)
    for _ in range(200):
        scene.step(0.05)
        distance = np.linalg.norm(scene.position[a] - scene.position[b], axis=1)
        assert (distance > (scene.radius[a] + scene.radius[b]) * (1 - 1e-9)).all()
