"""Tests of contacts of meshes that are carried over by their triangles, against answers that are all new."""

from __future__ import annotations

import numpy as np
import pytest

from collision_monitor.monitor.monitor import Monitor
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import from_rotation_vector
from collision_monitor.shapes.registry import Box, Mesh
from collision_monitor.world.arm import link

RATE, COUNT = 50.0, 18


def ring(around: int = 24, across: int = 12, radius: float = 0.25, thickness: float = 0.06) -> Mesh:
    """Closed mesh of a torus about z."""
    u, v = (2 * np.pi * np.arange(n) / n for n in (around, across))
    out = radius + thickness * np.cos(v)
    height = np.broadcast_to(thickness * np.sin(v), (around, across))
    corners = np.stack([np.outer(np.cos(u), out), np.outer(np.sin(u), out), height], axis=-1).reshape(-1, 3)
    i, j = (k.ravel() for k in np.mgrid[:around, :across])
    p, q = i * across + j, (i + 1) % around * across + j
    r, s = (i + 1) % around * across + (j + 1) % across, i * across + (j + 1) % across
    return Mesh(corners, np.concatenate([np.stack([p, q, r], axis=1), np.stack([p, r, s], axis=1)]))


SHAPES = (ring(), link(0.5, 0.08), ring(), Box((0.3, 0.2, 0.25)))


def monitors(tolerance: float, **settings: object) -> list[Monitor]:
    made = [Monitor(Profile(distance_tolerance=t, horizon=0.0, **settings)) for t in (tolerance, 0.0)]
    for monitor in made:
        for k in range(COUNT):
            monitor.add(k, SHAPES[k % len(SHAPES)], padding=0.01 if k == 1 else 0.0)
    return made


def drift(k: int, speed: float, spin: float):
    """Poses and twists, at step k, of bodies that move through each other."""
    rng = np.random.default_rng(4)
    position, turn = rng.uniform(0, 1.0, (COUNT, 3)), rng.normal(size=(COUNT, 3))
    linear, angular = rng.normal(scale=speed, size=(COUNT, 3)), rng.normal(scale=spin, size=(COUNT, 3))
    poses = np.hstack([position + linear * k / RATE, from_rotation_vector(turn + angular * k / RATE)])
    return round(k * 1e9 / RATE), np.arange(COUNT), poses, np.hstack([linear, angular])


@pytest.mark.parametrize(
    ("speed", "spin", "tolerance", "fewest"),
    [(0.0, 0.0, 1e-3, 100), (0.02, 0.05, 2e-3, 10), (0.5, 0.5, 0.05, 0), (3.0, 3.0, 0.05, 0)],
)
def test_carried_answers_hold_within_their_bound_and_the_tolerance(
    speed: float, spin: float, tolerance: float, fewest: int
) -> None:
    mine, truth = monitors(tolerance)
    spared = 0
    for k in range(40):
        a, b = (each.step(*drift(k, speed, spin)) for each in (mine, truth))
        spared += b.status.narrow_phase_tests - a.status.narrow_phase_tests
        assert np.array_equal(a.ended["id_b"], b.ended["id_b"])
        for name in ("id_a", "id_b", "phase", "duration", "status"):
            assert np.array_equal(a.contacts[name], b.contacts[name]), name
        off = np.abs(a.contacts["signed_distance"] - b.contacts["signed_distance"])
        assert np.all(off <= a.contacts["error_bound"] + b.contacts["error_bound"] + 1e-12)
    assert spared >= fewest


def test_a_restored_monitor_carries_the_same_answers() -> None:
    mine, _ = monitors(0.05)
    for k in range(20):
        mine.step(*drift(k, 0.5, 0.5))
    other = Monitor.restored(mine.profile, mine.snapshot())
    for k in range(20, 40):
        a, b = (each.step(*drift(k, 0.5, 0.5)) for each in (mine, other))
        assert a.contact_rows.tobytes() == b.contact_rows.tobytes()
    assert mine.digest == other.digest
