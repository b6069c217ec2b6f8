"""Segments in which a pair stays apart, against samples of the errors that are followed to both ends."""

from __future__ import annotations

import numpy as np
import pytest

import collision_monitor as cm
from collision_monitor.impact.body_impact import ShapePair, Tube, Window
from collision_monitor.motion.last_state import carry_on
from collision_monitor.records import STATE
from collision_monitor.uncertainty.obstacle_planes import ABOUT_ALL, make_obstacle, set_nodes
from collision_monitor.uncertainty.pair_errors import PairErrors, spin_rate, surface_bend
from collision_monitor.uncertainty.quiet_segments import stay_apart
from collision_monitor.uncertainty.samples.error_samples import make_workspace
from collision_monitor.uncertainty.samples.normal_samples import FURTHEST


def apart(shapes: list[cm.Shape], rows: np.ndarray, root: np.ndarray, turned: float, window: Window) -> bool:
    """Whether two shapes with these states stay apart in the window; root (6, 6) of the errors at time 0."""
    monitor = cm.Monitor()
    for k, shape in enumerate(shapes):
        monitor.add(k, shape)
    monitor.step(0, rows)
    table, parts, bodies = monitor.roster.multibody
    work, obstacle = make_workspace(), make_obstacle()
    for k in range(2):
        carry_on(bodies, k, 0.0, work.quaternion, work.motion[k])
    work.joint[:], work.frame[:] = root, np.eye(3)
    A, B = work.motion
    radii = (float(bodies.spin_radius[0]), float(bodies.spin_radius[1]))
    turning = ((turned, 0.0, 0.0, 0.0), (turned, 0.0, 0.0, 0.0))
    bend = 0.0
    if spin_rate(A) + spin_rate(B) > 0.0:
        bend = float(surface_bend(A, radii[0], window.end) + surface_bend(B, radii[1], window.end))
    errors = PairErrors(Tube(0.0, 0.0), turning, bend, float(root[0, 0]), 0.0, 0.0, radii, ABOUT_ALL)
    pair = ShapePair(A, B, bodies.first_shape[0], bodies.first_shape[1])
    set_nodes(table, parts, pair, window, window.end - window.begin, turning, ABOUT_ALL, work.scratch, obstacle)
    return bool(stay_apart(table, parts, pair, 0, errors, 0.0, obstacle, work))


def states(away: float) -> np.ndarray:
    rows = np.zeros(2, STATE)
    rows["id"], rows["quaternion"][:, 3] = (0, 1), 1.0
    rows["position"][1, 0] = away
    return rows


@pytest.mark.parametrize(("window", "sigma"), [((0.0, 0.1), 0.05), ((1.0, 2.0), np.hypot(0.03, 2.0 * 0.04))])
def test_balls_stay_apart_if_their_gap_exceeds_the_furthest_errors(window: tuple[float, float], sigma: float) -> None:
    root = np.diag([0.05] * 3 + [0.0] * 3) if window[0] == 0.0 else np.diag([0.03] * 3 + [0.04] * 3)
    balls = [cm.Sphere(0.3), cm.Sphere(0.2)]
    for factor in (0.98, 1.02):
        gap = factor * FURTHEST * sigma
        assert apart(balls, states(0.5 + gap), root, 0.0, Window(*window)) == (factor > 1.0)


def test_boxes_that_turn_and_stay_apart_have_no_error_that_meets() -> None:
    rng, box, quiet = np.random.default_rng(2), cm.Box((0.6, 0.3, 0.2)), 0
    root = np.diag([0.02] * 3 + [0.03] * 3)
    for _ in range(40):
        rows = states(rng.uniform(0.4, 1.2))
        rows["quaternion"] = rng.normal(size=(2, 4))
        rows["quaternion"] /= np.linalg.norm(rows["quaternion"], axis=1, keepdims=True)
        rows["angular"], rows["linear"][1] = rng.normal(size=(2, 3)), rng.normal(size=3)
        if not apart([box, box], rows, root, 0.03, Window(0.0, 0.15)):
            continue
        quiet += 1
        poses, twists = [], []
        for k in range(2):
            moved = rng.normal(size=(2000, 3)) * 0.02 * k
            turned = cm.shapes.pose.from_rotation_vector(0.03 * rng.normal(size=(2000, 3)))
            q = cm.shapes.pose.multiply(turned, np.tile(rows["quaternion"][k], (2000, 1)))
            poses.append(np.column_stack([rows["position"][k] + moved, q]))
            off = 0.03 * k * rng.normal(size=(2000, 3))
            twists.append(np.column_stack([rows["linear"][k] + off, np.tile(rows["angular"][k], (2000, 1))]))
        found = cm.time_of_impact_batch(box, poses[0], twists[0], box, poses[1], twists[1], 0.15, tolerance=1e-4)
        assert np.all(found.status == "clear")
    assert quiet > 5
