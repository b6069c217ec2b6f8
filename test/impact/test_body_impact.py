"""Predicted impacts against dense samples of the motions and against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from collision_monitor.impact.body_impact import ImpactQuery, make_scratch
from collision_monitor.impact.impact_record import HIT, IMPACT, UNRESOLVED
from collision_monitor.impact.pair_impacts import WHOLE, predict_pairs
from collision_monitor.impact.tree_impact import FULL
from collision_monitor.motion.bodies import Multibody, make_bodies, make_parts
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.records import ShapeType
from collision_monitor.shapes.pose import from_rotation_vector, multiply, rotation_matrix
from collision_monitor.shapes.registry import (
    Box,
    Capsule,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Shape,
    Sphere,
)
from collision_monitor.shapes.shape_table import ShapeTableBuilder

TOLERANCE = 1e-6
HORIZON = 2.0


class PairScene:
    """Independent pairs of bodies (2 k, 2 k + 1), with reference motions from t = 0."""

    def __init__(self, shapes: list[tuple[Shape, Shape]], rng: np.random.Generator, tube: float = 0.0) -> None:
        n = 2 * len(shapes)
        builder = ShapeTableBuilder()
        for a, b in shapes:
            builder.append(a)
            builder.append(b)
        self.table = builder.table
        self.parts = make_parts(len(self.table.kind))
        self.bodies = make_bodies(n)
        self.pairs = np.arange(n, dtype=np.int32).reshape(-1, 2)
        self.bodies.first_shape[:] = np.arange(n)
        self.bodies.spin_radius[:] = np.where(self.table.kind[:n] == ShapeType.SPHERE, 0.0, self.table.radius[:n])
        self.bodies.id[:] = np.arange(n)
        m = self.motion = self.bodies.motion
        m["radius"] = self.table.radius[:n]
        m["cover"] = HORIZON
        m["tube_0"] = m["tube_1"] = tube
        self.position = np.zeros((n, 3))
        self.position[1::2] = rng.normal(0, 1.2, (n // 2, 3))
        self.linear = rng.normal(0, 1, (n, 3))
        self.angular = rng.normal(0, 2, (n, 3))
        q = rng.normal(0, 1, (n, 4))
        self.quaternion = q / np.linalg.norm(q, axis=1, keepdims=True)

    def stand_still(self) -> None:
        self.position[:] = self.linear[:] = self.angular[:] = 0.0
        self.quaternion[:] = 0.0, 0.0, 0.0, 1.0

    def impacts(self, budget: int = 256, tolerance: float = TOLERANCE) -> NDArray[np.void]:
        m = self.motion
        m["x"], m["y"], m["z"] = self.position.T
        m["vx"], m["vy"], m["vz"] = self.linear.T
        m["wx"], m["wy"], m["wz"] = self.angular.T
        m["rotation"] = rotation_matrix(self.quaternion)
        events = np.zeros(len(self.pairs) + 1, IMPACT)
        hits, _ = predict_pairs(
            Multibody(self.table, self.parts, self.bodies),
            self.pairs,
            0.0,
            ImpactQuery(0.0, tolerance, budget),
            FULL,
            WHOLE,
            events,
            make_scratch(),
        )
        return events[:hits]

    def distances(self, t: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """Signed distances (N,) of the pairs at the time t, or at one time (N,) for each pair."""
        times = np.broadcast_to(t, len(self.pairs)).repeat(2)[:, None]
        position = np.zeros((len(self.table.kind), 3))
        rotation = np.zeros((len(self.table.kind), 3, 3))
        n = len(self.motion)
        position[:n] = self.position + self.linear * times
        rotation[:n] = rotation_matrix(multiply(from_rotation_vector(self.angular * times), self.quaternion))
        return contact_batch(self.table, position, rotation, self.pairs)[:, 0]


def any_box(rng: np.random.Generator) -> Shape:
    return Box(rng.uniform(0.05, 1.2, 3))


KINDS = {
    "sphere": lambda rng: Sphere(rng.uniform(0.1, 0.6)),
    "box": any_box,
    "rod": lambda rng: Box((2.0, 0.02, 0.02)),
    "plate": lambda rng: Box((1.0, 1.0, 0.001)),
    "capsule": lambda rng: Capsule(rng.uniform(0.1, 0.4), rng.uniform(0.2, 1.0)),
    "cylinder": lambda rng: Cylinder(rng.uniform(0.1, 0.4), rng.uniform(0.2, 1.0)),
    "cone": lambda rng: Cone(rng.uniform(0.1, 0.4), rng.uniform(0.2, 1.0)),
    "ellipsoid": lambda rng: Ellipsoid(rng.uniform(0.1, 0.6, 3)),
    "hull": lambda rng: ConvexHull(rng.normal(0, 0.3, (12, 3))),
    "half-space": lambda rng: HalfSpace(rng.normal(0, 1, 3), -1.0),
}


@pytest.mark.parametrize("kind_a", KINDS)
@pytest.mark.parametrize("kind_b", ["sphere", "box", "capsule", "cylinder", "hull", "half-space"])
@pytest.mark.parametrize("tube", [0.0, 0.003])
def test_no_impact_is_missed_and_none_is_late(kind_a: str, kind_b: str, tube: float) -> None:
    if "half-space" in (kind_a, kind_b):
        if kind_a == kind_b:
            return  # two unbounded bodies have no impact to predict
        kind_a, kind_b = sorted((kind_a, kind_b), key=lambda kind: kind == "half-space")
    rng = np.random.default_rng(len(kind_a) * 31 + len(kind_b))
    scene = PairScene([(KINDS[kind_a](rng), KINDS[kind_b](rng)) for _ in range(100)], rng, tube)
    if kind_b == "half-space":
        scene.linear[1::2] = scene.angular[1::2] = 0.0
    events = scene.impacts()
    lower = np.full(len(scene.pairs), np.inf)
    lower[events["i"] // 2] = events["lower"]
    round_off = 1e-9
    for t in np.linspace(0.0, HORIZON, 120):
        overlapping = scene.distances(t) < -round_off
        assert not np.any(overlapping & (t < lower)), "an overlap before the safe time"
    hits = events[events["status"] == HIT]
    assert len(hits) > 2
    upper = np.zeros(len(scene.pairs))
    upper[hits["i"] // 2] = hits["upper"]
    assert np.all(scene.distances(upper)[hits["i"] // 2] <= round_off), "not in contact by the upper end"
    assert np.all(hits["lower"] <= hits["upper"])
    # the safe time is also tight: the pair is nearly within the tube at that time
    at = np.where(np.isfinite(lower), lower, 0.0)
    near = scene.distances(at)[events["i"] // 2]
    settled = events["status"] == HIT
    reach = 2 * tube * (1 + events["lower"][settled]) + TOLERANCE
    # SAT bounds the distance of boxes from below; at a corner the bound can be half of the distance
    assert np.all(near[settled] <= 2 * reach + round_off)


def test_the_tube_holds_for_every_motion_inside_it() -> None:
    rng = np.random.default_rng(5)
    tube = 0.01
    scene = PairScene([(any_box(rng), any_box(rng)) for _ in range(200)], rng, tube)
    events = scene.impacts()
    for seed in range(8):
        shaken = PairScene([(Sphere(1.0), Sphere(1.0))] * 200, np.random.default_rng(seed))
        shaken.table = scene.table
        shaken.motion["radius"], shaken.bodies.spin_radius[:] = scene.motion["radius"], scene.bodies.spin_radius
        direction = rng.normal(0, 1, scene.position.shape)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        shaken.position = scene.position + tube * direction
        shaken.linear = scene.linear + tube * rng.choice([-1, 1], (len(direction), 1)) * direction
        shaken.angular, shaken.quaternion = scene.angular, scene.quaternion
        truth = shaken.impacts(tolerance=1e-9)
        stated = {int(e["key"]): e for e in events}
        for impact in truth[truth["status"] == HIT]:
            mine = stated[int(impact["key"])]  # KeyError: a missed collision
            assert mine["lower"] <= impact["upper"]
            assert mine["upper"] >= impact["lower"]
        happened = {int(e["key"]) for e in truth}
        assert {int(e["key"]) for e in events[events["status"] == HIT]} <= happened


def test_spheres_meet_when_the_closed_form_says() -> None:
    rng = np.random.default_rng(0)
    scene = PairScene([(Sphere(0.5), Sphere(0.25))] * 3, rng)
    scene.stand_still()
    scene.position[1], scene.linear[1] = (3, 0, 0), (-1.5, 0, 0)  # head on: (3 - 0.75) / 1.5
    scene.position[3], scene.linear[3] = (3, 0.75 + 1e-6, 0), (-1.5, 0, 0)  # passes a micrometre away
    scene.position[5], scene.linear[5] = (0.75, 0, 0), (1, 0, 0)  # touches and separates
    events = scene.impacts()
    assert [int(e["i"]) // 2 for e in events] == [0, 2]
    assert events[0]["lower"] <= 1.5 <= events[0]["upper"]
    assert events[0]["upper"] - events[0]["lower"] < 1e-6
    assert events[1]["lower"] == 0.0
    assert np.allclose([events[0]["normal_x"], events[0]["point_x"]], [1.0, 0.5])
    assert events[0]["closing_speed"] == pytest.approx(1.5)


def test_a_spinning_rod_finds_the_ball() -> None:
    rng = np.random.default_rng(0)
    scene = PairScene([(Box((2.0, 0.02, 0.02)), Sphere(0.05))], rng)
    scene.stand_still()
    scene.position[1] = (0.0, 0.9, 0.0)
    scene.angular[0] = (0, 0, 2.0)
    (event,) = scene.impacts()
    # the rod's flank is 0.01 from its axis, the ball's centre 0.9 from the pivot
    expected = (np.pi / 2 - np.arcsin(0.06 / 0.9)) / 2.0
    assert event["lower"] <= expected <= event["upper"]
    assert event["upper"] - event["lower"] < 1e-5


def test_a_thin_plate_stops_a_fast_bullet() -> None:
    rng = np.random.default_rng(0)
    scene = PairScene([(Box((1.0, 1.0, 0.001)), Sphere(0.0005))], rng)
    scene.stand_still()
    scene.position[1], scene.linear[1] = (0.2, 0.1, 700.0), (0, 0, -1000.0)
    (event,) = scene.impacts()
    expected = (700.0 - 0.0005 - 0.0005) / 1000.0
    assert event["lower"] <= expected + 1e-15 and event["upper"] >= expected - 1e-15
    assert event["upper"] - event["lower"] < 1e-8


def test_an_exhausted_budget_is_unresolved_not_clear() -> None:
    rng = np.random.default_rng(2)
    scene = PairScene([(any_box(rng), any_box(rng)) for _ in range(300)], rng)
    full = {int(e["key"]): e for e in scene.impacts()}
    short = {int(e["key"]): e for e in scene.impacts(budget=1)}
    assert set(full) <= set(short)
    assert any(e["status"] == UNRESOLVED for e in short.values())
    assert all(short[key]["lower"] <= full[key]["lower"] + 1e-12 for key in full)
