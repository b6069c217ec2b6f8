"""A call of everything public, with random arguments of a seed; the answer is bytes, so that two can be compared."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import collision_monitor as cm
from collision_monitor import codec, response, world
from collision_monitor.alerts.rules import Rules
from collision_monitor.codec import encode_descriptions, encode_states
from collision_monitor.detection.detector import Detector
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.records import CONTACT, STATE
from collision_monitor.response.contact_set import Bodies, Contacts
from collision_monitor.session import Session
from collision_monitor.session.replaying.replay import replay

GOLDEN = Path(__file__).parents[1] / "golden/balanced.mcap"

RULES = """
classes: {few: ["few*"]}
rules:
  far: {between: [few, any], caution: {distance: 1.0, distance_at_closest_approach: 0.5, post_encroachment_time: 1},
        warning: {time_to_collision: 1.5, time_headway: 0.5},
        critical: {required_deceleration: 2, separation_margin: 0},
        protective_separation: {reaction_time: 0.1, deceleration: 2}, quiet_at_rest: false}
"""


def as_bytes(value: Any) -> bytes:
    """The content of an answer."""
    if isinstance(value, np.ndarray):
        return value.tobytes()
    if isinstance(value, bytes | str | int | float | bool | np.generic) or value is None:
        return repr(value).encode()
    if isinstance(value, Mapping):
        return b"".join(as_bytes(each) for pair in sorted(value.items()) for each in pair)
    if isinstance(value, Sequence):
        return b"".join(map(as_bytes, value))
    if dataclasses.is_dataclass(value):
        return b"".join(as_bytes(getattr(value, each.name)) for each in dataclasses.fields(value))
    if isinstance(value, cm.Pose):
        return as_bytes([value.position, value.quaternion])
    return as_bytes({name: each for name, each in vars(value).items() if not name.startswith("_")})


def pose(g: np.random.Generator, spread: float = 1.0) -> cm.Pose:
    q = g.normal(size=4)
    return cm.Pose(g.normal(size=3) * spread, q / np.linalg.norm(q))


def mesh(g: np.random.Generator) -> cm.Mesh:
    """An L of two boxes, concave and closed."""
    outline = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]) * g.uniform(0.5, 1.5)
    n = len(outline)
    vertices = np.concatenate([np.column_stack([outline, np.full(n, z)]) for z in (0.0, 1.0)])
    caps = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    faces = [(a, c, b) for a, b, c in caps] + [(a + n, b + n, c + n) for a, b, c in caps]
    for k in range(n):
        j = (k + 1) % n
        faces += [(k, j, j + n), (k, j + n, k + n)]
    return cm.Mesh(vertices, faces)


def shapes(g: np.random.Generator) -> list[cm.Box]:
    """One of each kind of solid."""
    size = g.uniform(0.3, 1.0, 3)
    return [
        cm.Box(size), cm.Sphere(size[0]), cm.Capsule(size[0], size[1]), cm.Cylinder(size[0], size[1]),
        cm.Cone(size[0], size[1]), cm.Ellipsoid(size), cm.ConvexHull(g.normal(size=(12, 3))), mesh(g),
        cm.Points(g.normal(size=(40, 3)), 0.05), cm.HalfSpace((0, 0, 1), -3.0),
    ]  # fmt: skip


def two(g: np.random.Generator) -> tuple[Any, Any]:
    """Two shapes, of which one has an end."""
    own = shapes(g)
    return own[g.integers(9)], own[g.integers(10)]


def motion(g: np.random.Generator) -> cm.Motion:
    return cm.Motion(pose(g, 3.0), g.normal(size=3), g.normal(size=3) * 0.3)


def solid_motion(shape: Any, g: np.random.Generator) -> cm.Motion:
    return cm.Motion(pose(g, 3.0), g.normal(size=3)) if isinstance(shape, cm.HalfSpace) else motion(g)


def _contact(g: np.random.Generator) -> Any:
    a, b = two(g)
    c = cm.contact(a, pose(g), b, pose(g))
    return c.signed_distance, c.error_bound, c.normal, c.point_a, c.point_b


def _features(g: np.random.Generator) -> Any:
    a, b, x, y = cm.Box(g.uniform(0.3, 1, 3)), cm.Box(g.uniform(0.3, 1, 3)), pose(g), pose(g)
    return str(cm.contact_features(cm.contact(a, x, b, y), a, x, b, y))


def _impact(g: np.random.Generator) -> Any:
    a, b = two(g)
    found = cm.time_of_impact(a, motion(g), b, solid_motion(b, g))
    return found.status, found.lower, found.upper


def _conflicts(g: np.random.Generator) -> Any:
    """The conflicts of eight objects that go straight through each other's ways."""
    found = cm.conflicts([shapes(g)[k] for k in range(4)] * 2, [motion(g) for _ in range(8)], horizon=3.0)
    return np.array([(*each.entry, *each.exit) for each in found])


def _intervals(g: np.random.Generator) -> Any:
    a, b = two(g)
    return [(*each.entry, *each.exit) for each in cm.impacts(a, motion(g), b, solid_motion(b, g))]


def rows(g: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    q = g.normal(size=(n, 4))
    poses = np.hstack([g.normal(size=(n, 3)) * 3, q / np.linalg.norm(q, axis=1)[:, None]])
    return poses, np.hstack([g.normal(size=(n, 3)), g.normal(size=(n, 3)) * 0.3])


def _batch(g: np.random.Generator) -> Any:
    (pa, ta), (pb, tb) = rows(g, 6), rows(g, 6)
    a, b = shapes(g)[g.integers(8)], shapes(g)[g.integers(8)]
    found = cm.time_of_impact_batch(a, pa, ta, b, pb, tb)
    return found.lower, found.upper


def _times(g: np.random.Generator) -> Any:
    (pa, ta), (pb, tb) = rows(g, 8), rows(g, 8)
    found = cm.times_of_impact(shapes(g)[:8], pa, ta, shapes(g)[:8], pb, tb)
    return found.lower, found.upper


def _contacts(g: np.random.Generator) -> Any:
    found = cm.contacts(shapes(g)[:8], rows(g, 8)[0], shapes(g)[:8], rows(g, 8)[0])
    return found.signed_distance, found.error_bound


def _monitor(g: np.random.Generator, **settings: Any) -> Any:
    monitor = cm.Monitor(cm.Profile.named("balanced").replace(uncertainty_samples=64, **settings))
    n, own = 24, shapes(g)
    for k in range(n):
        monitor.add(k, own[k % 9], name=f"{'few' if k < 6 else 'many'}_{k}")
    monitor.add(n, own[9], name="floor", static=True, pose=cm.Pose())
    poses, twists = rows(g, n)
    out: list[Any] = []
    for step in range(4):
        result = monitor.step(step * 50_000_000, np.arange(n), poses, twists)
        out += [result.contacts, result.predictions]
        poses[:, :3] += twists[:, :3] * 0.05
    return out


def _pipeline(g: np.random.Generator) -> Any:
    """Alerts of a pipeline over some steps, and its snapshot continued."""
    pipeline = Pipeline("balanced", rules=Rules.parse(RULES))
    n, own = 20, shapes(g)
    described = [ObjectDescription(k, own[k % 8], name=f"{'few' if k < 8 else 'many'}_{k}") for k in range(n)]
    pipeline.on_shapes(encode_descriptions(0, "world", described))
    state = np.zeros(n, STATE)
    state["id"] = np.arange(n)
    poses, twists = rows(g, n)
    state["position"], state["quaternion"] = poses[:, :3] * 0.7, poses[:, 3:]
    state["linear"], state["angular"] = twists[:, :3], twists[:, 3:]
    out: list[Any] = []
    for step in range(4):
        outputs = pipeline.on_states(encode_states(step * 50_000_000, "world", step, state))
        assert outputs is not None
        out += [outputs.contacts, outputs.predictions, *outputs.alerts, pipeline.raised_alerts()]
        state["position"] += state["linear"] * 0.05
        pipeline = Pipeline.restored(pipeline.snapshot(), "world")
        pipeline.on_shapes(encode_descriptions(0, "world", described))
    return out


def _session(_: np.random.Generator) -> Any:
    report = replay(Session(GOLDEN))
    return report.steps, report.compared, report.differing, report.digest


def _detector(g: np.random.Generator, threads: int) -> Any:
    n = 300
    detector = Detector([cm.Box(g.uniform(0.2, 0.6, 3)) for _ in range(n)], threads=threads)
    poses = rows(g, n)[0]
    found = detector.detect(poses[:, :3], poses[:, 3:])
    return found.pairs, found.table


def _bodies(g: np.random.Generator) -> tuple[Bodies, Contacts]:
    n, m = 5, 4
    inertia = np.tile(np.eye(3), (n, 1, 1))
    bodies = Bodies(g.uniform(0.5, 2, n), inertia, g.normal(size=(n, 3)), g.normal(size=(n, 3)))
    normal = g.normal(size=(m, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    return bodies, Contacts(np.arange(m), np.arange(1, m + 1), normal, g.normal(size=(m, 3)), g.normal(size=(m, 3)))


def _rigid(g: np.random.Generator) -> response.RigidBody:
    return response.RigidBody(2.0, np.eye(3), g.normal(size=3), g.normal(size=3), g.normal(size=3))


def _world(g: np.random.Generator) -> Any:
    scene = world.make_scene("fleet", objects=20, seed=int(g.integers(1000)))
    return [scene.step(0.05) for _ in range(3)]


def _spheres(g: np.random.Generator) -> Any:
    spheres = world.HardSpheres(30, 0.2, seed=int(g.integers(1000)))
    spheres.run(0.5)
    return spheres.positions, spheres.velocities


def _vectors(g: np.random.Generator, n: int = 3) -> list[np.ndarray]:
    return [g.normal(size=3) for _ in range(n)]


def _decomposition(g: np.random.Generator) -> Any:
    found = cm.convex_decomposition(mesh(g))
    return found.surface_error, found.volume_error, [part.points for part in found.parts]


Call = Callable[[np.random.Generator], Any]

CALLS: dict[str, Call] = {
    "contact": _contact,
    "distance": lambda g: cm.distance(*[f(g) for f in (lambda g: two(g)[0], pose, lambda g: two(g)[0], pose)]),
    "overlap": lambda g: [
        cm.overlap(mesh(g), pose(g), shapes(g)[g.integers(9)], pose(g)),
        cm.overlap(cm.Box((1, 1, 1)), pose(g), cm.Box((1, 2, 1)), pose(g), test="cascade"),
    ],
    "contact_features": _features,
    "contacts": _contacts,
    "time_of_impact": _impact,
    "time_of_impact_batch": _batch,
    "times_of_impact": _times,
    "impacts": _intervals,
    "conflicts": _conflicts,
    "contains": lambda g: cm.contains(shapes(g)[g.integers(8)], pose(g), g.normal(size=(30, 3))),
    "cast_ray": lambda g: cm.cast_ray(shapes(g)[g.integers(8)], pose(g), *_vectors(g, 2)).distance,
    "points_within": lambda g: cm.points_within(shapes(g)[8], pose(g), shapes(g)[g.integers(8)], pose(g), 0.3),
    "kdop": lambda g: cm.kdop(shapes(g)[g.integers(8)], np.concatenate([np.eye(3), g.normal(size=(3, 3))])).excess,
    "convex_decomposition": _decomposition,
    "vertex_face_impact": lambda g: cm.vertex_face_impact(g.normal(size=(8, 3))),
    "edge_edge_impact": lambda g: cm.edge_edge_impact(g.normal(size=(8, 3))),
    "Monitor": _monitor,
    "Monitor on two threads": lambda g: _monitor(g, threads=2, contact_points=4),
    "Monitor that keeps contacts": lambda g: _monitor(g, distance_tolerance=0.01, mesh_impact_tolerance=0.1),
    "Pipeline with alerts": _pipeline,
    "Session and replay": _session,
    "Detector": lambda g: _detector(g, 1),
    "Detector on two threads": lambda g: _detector(g, 2),
    "codec": lambda g: codec.encode_contacts(
        0, "world", 1, np.zeros(2, CONTACT), np.arange(3, dtype=np.uint32), [f"c_{k}" for k in g.integers(99, size=3)]
    ),
    "response.reflect": lambda g: response.reflect(*_vectors(g, 2)),
    "response.clamp": lambda g: response.clamp(*_vectors(g, 2)),
    "response.last_free": lambda g: response.last_free(*_vectors(g, 3)),
    "response.collide": lambda g: response.collide(*_vectors(g, 3), 1.0, 2.0),
    "response.stick": lambda g: response.stick(*_vectors(g, 2), 1.0, 2.0),
    "response.average": lambda g: response.average(*_vectors(g, 3)),
    "response.swap": lambda g: response.swap(*_vectors(g, 3)),
    "response.penalty_force": lambda g: response.penalty_force(0.1, 0.2, g.normal(size=3), 100.0),
    "response.spring_stiffness": lambda g: response.spring_stiffness(*g.uniform(0.1, 1, 3)),
    "response.damping_for": lambda g: response.damping_for(*g.uniform(0.1, 1, 3)),
    "response.mass_properties": lambda g: response.mass_properties(shapes(g)[g.integers(5)]),
    "response.collide_rotating": lambda g: response.collide_rotating(_rigid(g), _rigid(g), *_vectors(g, 2)),
    "response.collide_together": lambda g: response.collide_together(
        g.normal(size=(4, 3)), np.ones(4), [(0, 1), (1, 2), (2, 3)], g.normal(size=(3, 3))
    ),
    "response.bodies_collide_together": lambda g: response.bodies_collide_together(*_bodies(g)),
    "response.hold_contacts": lambda g: response.hold_contacts(*_bodies(g), friction=0.3),
    "response.move_as_one": lambda g: response.move_as_one(_bodies(g)[0], g.normal(size=(5, 3)), [(0, 1), (2, 3)]),
    "world.make_scene": _world,
    "world.HardSpheres": _spheres,
}  # fmt: skip
"""By name; names without a dot are those of `collision_monitor`."""

ELSEWHERE = {
    "load_mesh": "reads a file and keeps nothing",
    "plot": "draws with matplotlib.pyplot, which belongs to one thread",
    "world.check_path": "looks at a path",
    "world.describe": "a constant text",
    "world.scene_names": "a constant text",
}
"""Public functions that have no call here, with the reason."""


def answer(name: str, seed: int) -> bytes:
    """The answer of a call to the arguments of a seed."""
    return as_bytes(CALLS[name](np.random.default_rng([seed, len(name)])))
