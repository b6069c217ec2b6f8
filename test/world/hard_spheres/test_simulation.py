"""Tests of the event-driven simulation against a plain one, the conservation laws, and the theory of gases."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_spheres import simulate
from scipy import stats

import collision_monitor as cm
from collision_monitor.errors import InputError
from collision_monitor.world.hard_spheres.simulation import carnahan_starling
from collision_monitor.world.hard_spheres.starting_points import overlapping_spheres

HardSpheres = cm.world.HardSpheres


def overlaps(spheres, part=1e-12):
    """Pairs that overlap by more than this part of their radii."""
    return overlapping_spheres(
        spheres.positions, spheres.radii * (1 - part), spheres.side if spheres.is_periodic else None
    )


@settings(max_examples=12)
@given(st.integers(0, 2**32 - 1), st.booleans(), st.sampled_from([1.0, 0.7]))
def test_collisions_are_those_of_a_plain_simulation(seed, periodic, restitution):
    """Chaos multiplies round-off by about 10 for each collision of a sphere, so only the first ones are compared."""
    random = np.random.default_rng(seed)
    radii = random.uniform(0.2, 0.6, 7)
    start = HardSpheres(7, 0.02, seed % 1000, radii=radii, walls="periodic" if periodic else "reflecting")
    spheres = HardSpheres.placed(
        start.positions, start.velocities, start.side, restitution=restitution, radii=radii,
        walls="periodic" if periodic else "reflecting",
    )  # fmt: skip
    expected = simulate(
        start.positions, start.velocities, radii, start.side, periodic=periodic, restitution=restitution, collisions=20
    )
    found = spheres.run(expected[-1][0], record=True)[:15].tolist()
    assert [(a, b) if b < 0 else (min(a, b), max(a, b)) for _, a, b in found] == [event[1:] for event in expected[:15]]
    assert [event[0] for event in found] == pytest.approx([event[0] for event in expected[:15]], rel=1e-6)


@pytest.mark.parametrize("seed", [6, 12, 678])
def test_spheres_that_have_just_collided_can_be_placed(seed):
    """The last collision before the start leaves a sphere touching another or a wall, by round-off with an overlap."""
    radii = np.random.default_rng(6678 if seed == 678 else seed).uniform(0.2, 0.6, 7)
    spheres = HardSpheres(7, 0.02, seed, radii=radii, walls="reflecting")
    again = HardSpheres.placed(spheres.positions, spheres.velocities, spheres.side, radii=radii, walls="reflecting")
    assert np.allclose(again.positions, spheres.positions, rtol=1e-12, atol=0.0)


@pytest.mark.parametrize("walls", ["reflecting", "periodic"])
def test_the_runs_into_which_a_time_is_divided_do_not_matter(walls):
    whole, parts = (HardSpheres(150, 0.3, 5, walls=walls) for _ in range(2))
    whole.run(2.0)
    for _ in range(128):
        parts.run(1 / 64)
    assert whole.collisions == parts.collisions > 1000
    assert whole.positions.tobytes() == parts.positions.tobytes()
    assert whole.velocities.tobytes() == parts.velocities.tobytes()


def test_the_seed_alone_decides():
    first, again, other = (HardSpheres(50, 0.2, seed) for seed in (3, 3, 4))
    assert first.positions.tobytes() == again.positions.tobytes() != other.positions.tobytes()


def test_energy_and_momentum_are_conserved_over_a_quarter_of_a_million_collisions():
    spheres = HardSpheres(300, 0.4, walls="periodic", radii=np.linspace(0.4, 0.6, 300))
    energy = spheres.energy
    spheres.run(100.0)
    assert spheres.collisions > 250_000
    assert spheres.energy == pytest.approx(energy, rel=1e-12)
    moved = (spheres.masses * np.linalg.norm(spheres.velocities, axis=1)).sum()
    assert np.abs(spheres.momentum).max() < 1e-12 * moved


@pytest.mark.parametrize("walls", ["reflecting", "periodic"])
@pytest.mark.parametrize("restitution", [1.0, 0.8])
def test_no_spheres_overlap_at_any_time(walls, restitution):
    spheres = HardSpheres(400, 0.4, 2, restitution, np.random.default_rng(0).uniform(0.3, 0.6, 400), walls)
    for _ in range(100):
        spheres.run(0.0371)
        assert not len(overlaps(spheres))
        if walls == "reflecting":
            room = np.minimum(spheres.positions, spheres.side - spheres.positions) - spheres.radii[:, None]
            assert room.min() > -1e-12 * spheres.side


@pytest.mark.parametrize("packing", [0.1, 0.25, 0.45])
def test_the_pressure_is_that_of_carnahan_and_starling(packing):
    spheres = HardSpheres(2048, packing, walls="periodic")
    spheres.run(4.0)
    spheres.run(120.0 if packing < 0.2 else 40.0)
    assert spheres.compressibility == pytest.approx(carnahan_starling(packing), rel=5e-3)
    assert spheres.packing == pytest.approx(packing)


def test_the_walls_feel_the_pressure_of_the_gas():
    """The centres of N spheres push with a force N kT / (L - 2 R) against each wall, as if they were points."""
    spheres = HardSpheres(500, 1e-3)
    spheres.run(8000.0)
    room = 1 - 2 * spheres.radii[0] / spheres.side
    assert spheres.compressibility == pytest.approx(carnahan_starling(1e-3) / room, rel=0.005)


def test_velocities_follow_maxwell():
    spheres = HardSpheres(3000, 0.3, 7, radii=np.repeat([0.4, 0.6], 1500))
    spheres.run(10.0)
    scaled = spheres.velocities * np.sqrt(spheres.masses / spheres.masses.mean())[:, None]
    assert stats.kstest(scaled.ravel(), "norm").pvalue > 0.01
    square = (scaled**2).sum(axis=1)
    assert (square**2).mean() / square.mean() ** 2 == pytest.approx(5 / 3, rel=0.05)
    light, heavy = (0.5 * (spheres.masses[part] * (spheres.velocities[part] ** 2).sum(axis=1)).mean()
                    for part in (slice(1500), slice(1500, None)))  # fmt: skip
    assert light == pytest.approx(heavy, rel=0.1)


def test_granular_gas_cools_by_haffs_law():
    """T = T0 / (1 + t / tau)^2, 1 / tau = (1 - e^2) / 6 times the collisions per sphere and second of Enskog."""
    restitution, packing, count = 0.95, 0.1, 3000
    spheres = HardSpheres(count, packing, 1, restitution, walls="periodic")
    temperature = spheres.energy / (1.5 * count)
    at_contact = (1 - packing / 2) / (1 - packing) ** 3
    rate = 4 * math.sqrt(math.pi) * (6 * packing / math.pi) * at_contact * math.sqrt(temperature)
    tau = 6 / ((1 - restitution**2) * rate)
    for _ in range(6):
        spheres.run(tau / 2)
        expected = temperature / (1 + spheres.time / tau) ** 2
        assert spheres.energy / (1.5 * count) == pytest.approx(expected, rel=0.04)


@pytest.mark.parametrize("restitution", [0.0, 0.1, 0.5])
@pytest.mark.parametrize("walls", ["reflecting", "periodic"])
def test_inelastic_collapse_does_not_stop_the_time(restitution, walls):
    spheres = HardSpheres(200, 0.2, 1, restitution, walls=walls)
    last = spheres.energy
    for _ in range(5):
        spheres.run(20.0)
        assert spheres.energy <= last * (1 + 1e-12)
        last = spheres.energy
    assert spheres.collisions < 1_000_000
    assert not len(overlaps(spheres))


def test_three_in_a_row_collapse_and_end():
    """Below e = 7 - 4 sqrt(3), three spheres in a row collide without end within a finite time."""
    spheres = HardSpheres.placed(
        [[2.0, 5, 5], [5.0, 5, 5], [8.0, 5, 5]], [[1.0, 0, 0], [0, 0, 0], [-1.0, 0, 0]], 10.0, restitution=0.05
    )
    spheres.run(30.0)
    assert 2 < spheres.collisions < 10_000
    assert not len(overlaps(spheres))


def test_two_spheres_meet_at_the_exact_time():
    spheres = HardSpheres.placed([[1.0, 2, 2], [3.5, 2, 2]], [[1.0, 0, 0], [-2.0, 0, 0]], 4.0)
    happened = spheres.run(0.5 + 1e-12, record=True)
    assert happened.tolist() == [(0.5, 0, 1)]
    assert spheres.velocities[:, 0].tolist() == [-2.0, 1.0]


def test_a_graze_that_steps_would_miss_is_a_collision():
    """Offset 0.999 of the sum of the radii, at 100 m/s: the overlap lasts 0.9 ms."""
    spheres = HardSpheres.placed([[5.0, 5, 5], [10.0, 5.999, 5]], [[100.0, 0, 0], [0, 0, 0]], 30.0)
    happened = spheres.run(0.1, record=True)
    assert happened["b"].tolist() == [1]
    assert happened["time"][0] == pytest.approx((5 - math.sqrt(1 - 0.999**2)) / 100, rel=1e-12)


def test_a_sphere_meets_the_image_of_another():
    spheres = HardSpheres.placed([[1.0, 5, 5], [9.0, 5, 5]], [[-1.0, 0, 0], [0.0, 0, 0]], 10.0, walls="periodic")
    assert spheres.run(1.0 + 1e-9, record=True).tolist() == [(1.0, 0, 1)]


def test_one_sphere_alone_bounces_between_the_walls():
    spheres = HardSpheres.placed([[0.75, 1, 1]], [[1.0, 0, 0]], 2.0, restitution=0.5)
    happened = spheres.run(4.0, record=True)
    assert happened["b"].tolist() == [-2, -1]
    assert happened["time"].tolist() == [0.75, 2.75]
    assert spheres.positions[0, 0] == pytest.approx(0.5 + 1.25 * 0.25)


def test_spheres_at_rest_and_identical_speeds_are_no_events():
    still = HardSpheres.placed([[1.0, 1, 1], [3.0, 1, 1]], np.zeros((2, 3)), 4.0)
    assert not len(still.run(1e6, record=True))
    assert still.positions.tolist() == [[1.0, 1, 1], [3.0, 1, 1]]


def test_lists_grow_for_large_spheres_among_small_ones():
    spheres = HardSpheres(404, 0.2, 3, radii=np.repeat([0.6, 0.1], [4, 400]))
    spheres.run(0.5)
    assert spheres._state.neighbours.shape[1] > 48
    assert not len(overlaps(spheres))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"count": 0}, "count: expected a whole number from 1"),
        ({"count": 2.0}, "count"),
        ({"packing": 0.0}, "packing: expected 1e-06 to 0.7"),
        ({"packing": math.nan}, "packing"),
        ({"packing": 0.7, "count": 5}, "packing: expected"),
        ({"seed": -1}, "seed"),
        ({"restitution": 1.1}, "restitution: expected 0 to 1, got 1.1"),
        ({"restitution": math.nan}, "restitution"),
        ({"radii": [0.5, 0.5]}, "radii: expected one number or 100 numbers"),
        ({"radii": -1.0}, "radii: expected finite lengths above 0"),
        ({"radii": np.geomspace(1, 11, 100)}, "radii: expected at most 10 times"),
        ({"walls": "soft"}, "walls: expected one of reflecting, periodic, got 'soft'"),
        ({"count": 10, "packing": 0.3, "walls": "periodic"}, "more spheres or reflecting walls"),
    ],
)
def test_impossible_gases_are_refused(arguments, words):
    with pytest.raises(InputError, match=words):
        HardSpheres(**{"count": 100, "packing": 0.1, **arguments})


@pytest.mark.parametrize(
    ("positions", "side", "words"),
    [
        ([[1, 1, 1], [1.5, 1, 1]], 4.0, "spheres 0 and 1 overlap"),
        ([[1, 1, 1], [3.9, 1, 1]], 4.0, "between the walls"),
        ([[1, 1], [3, 1]], 4.0, "positions: expected an array"),
        ([[1, 1, 1], [np.nan, 1, 1]], 4.0, "finite"),
        ([[1, 1, 1]], 4.0, "one row for each"),
        ([[1, 1, 1], [3, 1, 1]], math.inf, "side: expected a finite length"),
        ([[1, 1, 1], [3, 1, 1]], 0.5, "wider than the largest sphere"),
    ],
)
def test_impossible_places_are_refused(positions, side, words):
    with pytest.raises(InputError, match=words):
        HardSpheres.placed(positions, np.zeros((2, 3)), side)


@pytest.mark.parametrize("seconds", [-1.0, math.inf, math.nan])
def test_impossible_times_are_refused(seconds):
    with pytest.raises(InputError, match="seconds: expected a finite time"):
        HardSpheres(2, 0.1).run(seconds)


def test_there_is_no_pressure_before_the_first_run():
    assert math.isnan(HardSpheres(2, 0.1).pressure)
