"""Bodies of all kinds that turn, jump and change: steps agree with `contact` of every pair, and nothing is late."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import collision_monitor as cm

Pair = tuple[int, int]
_TORUS = trimesh.creation.torus(1.0, 0.4, major_sections=12, minor_sections=6)
_STAR = trimesh.creation.icosphere(1)
_STAR.vertices[::3] *= 0.5
_INNER = trimesh.creation.box((1.4, 1.4, 1.4))
_INNER.invert()
_HOLLOW = trimesh.util.concatenate([trimesh.creation.box((2, 2, 2)), _INNER])


def _mesh(of: trimesh.Trimesh) -> Callable[[np.random.Generator, float], cm.Shape]:
    return lambda rng, s: cm.Mesh(of.vertices * s * rng.uniform(0.7, 1.4, 3), of.faces)


KINDS: dict[str, Callable[[np.random.Generator, float], object]] = {
    "sphere": lambda rng, s: cm.Sphere(s),
    "box": lambda rng, s: cm.Box(s * rng.uniform(0.3, 2.0, 3)),
    "capsule": lambda rng, s: cm.Capsule(0.5 * s, 1.5 * s),
    "cylinder": lambda rng, s: cm.Cylinder(0.6 * s, 1.2 * s),
    "cone": lambda rng, s: cm.Cone(0.6 * s, 1.3 * s),
    "ellipsoid": lambda rng, s: cm.Ellipsoid(s * rng.uniform(0.3, 1.5, 3)),
    "hull": lambda rng, s: cm.ConvexHull(rng.normal(size=(12, 3)) * s),
    "ring": _mesh(_TORUS),
    "star": _mesh(_STAR),
    "hollow": _mesh(_HOLLOW),
    "cloud": lambda rng, s: cm.Points(rng.normal(size=(int(rng.integers(1, 150)), 3)) * s * 0.6, 0.05 * s),
    "compound": lambda rng, s: [(cm.Sphere(0.5 * s), cm.Pose((0, 0, s))), (_mesh(_STAR)(rng, s), cm.Pose((s, 0, 0)))],
}


class Scene:
    """Bodies with their true motions. An error within `slack` (m) of contact is the profile's."""

    def __init__(self, seed: int, profile: str) -> None:
        self.rng = np.random.default_rng(seed)
        self.monitor = cm.Monitor(profile=profile)
        self.slack = 0.15 if profile == "fast" else 2e-3
        self.shapes = {i: self._shape() for i in range(1, 7)}
        poses = {i: self._pose() for i in self.shapes}
        self.motions = {i: cm.Motion(pose, *self._twist(pose)) for i, pose in poses.items()}
        self.motions[1] = cm.Motion(self.motions[1].pose)
        for i, shape in self.shapes.items():
            self.monitor.add(i, shape, static=i == 1, pose=self.motions[i].pose if i == 1 else None)
        self.time = 0
        self.onsets = 0
        self.before: tuple[set[Pair], dict[Pair, float]] | None = None
        self.changed: set[int] = set()

    def _shape(self) -> object:
        return KINDS[self.rng.choice(list(KINDS))](self.rng, 10 ** self.rng.uniform(-0.7, 0.5))

    def _pose(self) -> cm.Pose:
        return cm.Pose(self.rng.normal(size=3) * 3, Rotation.random(rng=self.rng).as_quat())

    def _twist(self, pose: cm.Pose) -> tuple[np.ndarray, np.ndarray]:
        """Back to the middle."""
        linear = self.rng.normal(size=3) - self.rng.uniform(0.5, 2.0) * pose.position
        return linear, self.rng.normal(size=3) * self.rng.choice([0, 2])

    def step(self) -> None:
        ids = [i for i in self.motions if i != 1]
        moving = [self.motions[i] for i in ids]
        poses = [np.concatenate([m.pose.position, m.pose.quaternion]) for m in moving]
        result = self.monitor.step(self.time, ids, poses, [np.concatenate([m.linear, m.angular]) for m in moving])
        found = {(int(c["id_a"]), int(c["id_b"])): c for c in result.contacts}
        touching: set[Pair] = set()
        for i, j in combinations(self.motions, 2):
            exact = cm.contact(self.shapes[i], self.motions[i].pose, self.shapes[j], self.motions[j].pose)
            if exact.signed_distance < -self.slack and exact.signed_distance + exact.error_bound < 0.0:
                touching.add((i, j))
                assert (i, j) in found, exact
            if (i, j) in found:
                apart = abs(float(found[i, j]["signed_distance"]) - exact.signed_distance)
                assert apart <= found[i, j]["error_bound"] + exact.error_bound + 1e-9
        self._check_onsets(touching)
        soonest = {(int(p["id_a"]), int(p["id_b"])): float(p["lower"]) for p in result.predictions}
        self.before = set(found), soonest

    def _check_onsets(self, touching: set[Pair]) -> None:
        """Each contact that began was one before, or was predicted for this time."""
        if self.before is None:
            return
        contacts, soonest = self.before
        for pair in touching - contacts:
            if not self.changed.intersection(pair):
                self.onsets += 1
                assert soonest.get(pair, np.inf) <= self.elapsed + 1e-3

    def move(self) -> None:
        elapsed = int(self.rng.choice([2, 10, 30])) * 10_000_000
        self.time += elapsed
        self.elapsed = elapsed * 1e-9
        self.changed = set()
        for i in [i for i in self.motions if i != 1]:
            pose, chance = self.motions[i].at(self.elapsed), self.rng.random()
            if chance < 0.06:
                pose = self._pose()
                self.changed.add(i)
            elif chance < 0.08:
                self.shapes[i] = self._shape()
                self.monitor.add(i, self.shapes[i], replace=True)
                self.changed.add(i)
            twist = self._twist(pose) if chance > 0.8 else (self.motions[i].linear, self.motions[i].angular)
            self.motions[i] = cm.Motion(pose, *twist)


@pytest.mark.parametrize("profile", ["balanced", "fast", "exact"])
def test_every_step_agrees_with_the_contacts_of_all_pairs(profile: str) -> None:
    onsets = 0
    for seed in range(5):
        scene = Scene(seed, profile)
        for _ in range(20):
            scene.step()
            scene.move()
        onsets += scene.onsets
    assert onsets > 10
