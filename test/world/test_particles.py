"""Tests of the particle box: conservation, walls, and the pair search against brute force."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from collision_monitor.world.particles import RADII, Particles, _overlapping_pairs


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
    scene = Particles(2, 1, None)
    scene.radius[:], scene.mass[:] = 0.1, 1.0
    scene.position = np.array([[0.4, 0.8, 0.8], [1.2, 0.8, 0.8]])
    scene.velocity = np.array([[1.0, 0, 0], [-1.0, 0, 0]])
    for _ in range(50):
        scene.step()
    assert scene.velocity.tolist() == [[-1.0, 0, 0], [1.0, 0, 0]]


def test_a_long_step_steps_over_no_collision():
    scene = Particles(2, 1, None)
    scene.radius[:], scene.mass[:] = 0.1, 1.0
    scene.position = np.array([[0.2, 0.8, 0.8], [1.4, 0.8, 0.8]])
    scene.velocity = np.array([[1.0, 0, 0], [-1.0, 0, 0]])
    scene.step(1.0)
    assert scene.velocity[:, 0].tolist() == [-1.0, 1.0]


@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.integers(1, 8))
def test_the_pair_search_finds_what_brute_force_finds(seed, count, cells):
    random = np.random.default_rng(seed)
    cell_size = 2 * RADII[1]
    position = random.uniform(-0.1, cells * cell_size + 0.1, (count, 3))
    radius = random.uniform(*RADII, count)
    found = _overlapping_pairs(position, radius, cell_size, cells)
    a, b = np.triu_indices(count, 1)
    touching = ((position[a] - position[b]) ** 2).sum(axis=1) <= (radius[a] + radius[b]) ** 2
    expected = {(int(i), int(j)) for i, j in zip(a[touching], b[touching], strict=True)}
    assert {(int(i), int(j)) for i, j in found} == expected
    assert len(found) == len(expected)
