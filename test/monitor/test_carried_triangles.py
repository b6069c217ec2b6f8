"""Tests of contacts of meshes that are carried over by their triangles, against answers that are all new."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from collision_monitor.geometry.pose import from_rotation_vector
from collision_monitor.geometry.shapes import Box, Mesh
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.records import ContactStatus
from collision_monitor.settings.profile import Profile
from collision_monitor.world.arm import link

RATE, COUNT = 50.0, 18


def ring() -> Mesh:
    torus = trimesh.creation.torus(0.25, 0.06, major_sections=24, minor_sections=12)
    return Mesh(torus.vertices, torus.faces)


SHAPES = (ring(), link(0.5, 0.08), Box((0.3, 0.2, 0.25)))


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
    ("speed", "spin", "tolerance"), [(0.0, 0.0, 1e-3), (0.02, 0.05, 2e-3), (0.5, 0.5, 0.05), (3.0, 3.0, 0.05)]
)
def test_carried_answers_hold_within_their_bound_and_the_tolerance(speed: float, spin: float, tolerance: float) -> None:
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
        assert np.all(a.contacts["error_bound"] <= b.contacts["error_bound"] + tolerance + 1e-9)
    assert spared > 20


def test_a_carried_contact_of_a_model_bounds_the_distance_of_its_object() -> None:
    hulls, _ = monitors(0.05, model_mesh="convex_hull", model_error=0.05)
    _, truth = monitors(0.05)
    spared = 0
    for k in range(40):
        a, b = (each.step(*drift(k, 0.3, 0.3)) for each in (hulls, truth))
        spared += len(a.contacts) - a.status.narrow_phase_tests
        found = {(row["id_a"], row["id_b"]): row for row in a.contacts}
        for row in b.contacts:  # none is missed
            mine = found[row["id_a"], row["id_b"]]
            off = abs(mine["signed_distance"] - row["signed_distance"])
            assert off <= mine["error_bound"] + row["error_bound"] + 1e-12
        touching = {(row["id_a"], row["id_b"]) for row in b.contacts}
        certain = {pair for pair, row in found.items() if row["status"] == ContactStatus.TOUCHING}
        assert certain <= touching
    assert spared > 100


def test_a_restored_monitor_carries_the_same_answers() -> None:
    mine, _ = monitors(0.05)
    for k in range(20):
        mine.step(*drift(k, 0.5, 0.5))
    other = Monitor.restored(mine.profile, mine.snapshot())
    for k in range(20, 40):
        a, b = (each.step(*drift(k, 0.5, 0.5)) for each in (mine, other))
        assert a.contact_rows.tobytes() == b.contact_rows.tobytes()
    assert mine.digest == other.digest
