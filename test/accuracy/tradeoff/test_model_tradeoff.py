"""Tests of models of meshes against the meshes, on bodies with known distances, and of the command."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from collision_monitor.accuracy.playback import Step
from collision_monitor.accuracy.tradeoff.model_tradeoff import model_tradeoff
from collision_monitor.cli.main import main
from collision_monitor.errors import InputError
from collision_monitor.geometry.polyhedra import is_closed
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.pose import Pose
from collision_monitor.world import make_scene
from collision_monitor.world.arm import lathe
from collision_monitor.world.scene import state_array

REEL = lathe([(0, -0.5), (0.4, -0.5), (0.4, -0.4), (0.1, -0.4), (0.1, 0.4), (0.4, 0.4), (0.4, 0.5), (0, 0.5)], 4)
"""A thin core between two square flanges. Its hull is a box of 0.4 sqrt(2) x 0.4 sqrt(2) x 1 m."""
BALL = lathe([(0, -0.05), (0.05, 0), (0, 0.05)], 4)
OBJECTS = [ObjectDescription(1, REEL), ObjectDescription(2, BALL, static=True, pose=Pose((1, 0, 0)))]


def approach(steps: int = 5) -> list[Step]:
    """Return steps in which the reel moves along x until the ball is between its flanges, 5 cm from its core."""
    found = []
    for k, x in enumerate(np.linspace(0.4, 0.8, steps)):
        states = state_array(np.array([1], np.uint32))
        states["position"][0, 0], states["linear"][0, 0] = x, 1.0
        found.append((k * 100_000_000, states))
    return found


def test_what_is_known_of_a_reel_and_a_ball() -> None:
    exact, sphere, hull = model_tradeoff("reel", OBJECTS, approach(), ["sphere", "convex_hull"])
    assert (exact.model, exact.alarms, exact.distance_error_m) == ("exact", 0, 0.0)
    # the corners point along x: the flanges reach to 0.4 m, the core to 0.1 m, and the corner of the ball to 0.05 m
    assert (hull.model, hull.misses, hull.outside_bound) == ("convex_hull", 0, 0)
    assert hull.alarms == hull.false_alarms == 3, "from x = 0.6 m on the ball is between the flanges"
    assert hull.distance_error_m > 0.25
    assert (sphere.misses, sphere.outside_bound) == (0, 0)
    assert sphere.false_alarms >= hull.false_alarms
    assert exact.step_ms > 0.0 and hull.step_ms > 0.0


def test_the_arm_is_made_of_closed_concave_meshes_and_its_twists_are_those_of_its_motion() -> None:
    scene = make_scene("arm")
    assert all(is_closed(shape.faces) for d in scene.descriptions for shape, _ in d.shapes)
    scene.step(0.7)
    before = scene.states()
    after = scene.step(1e-6)
    moved = (after["position"] - before["position"]) / 1e-6
    assert np.allclose(moved, before["linear"], atol=1e-4)
    turned = Rotation.from_quat(after["quaternion"]) * Rotation.from_quat(before["quaternion"]).inv()
    assert np.allclose(turned.as_rotvec() / 1e-6, before["angular"], atol=1e-4)


def test_the_command_names_the_models(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--scene", "clutter", "--objects", "12", "--seconds", "0.1", "--model", "sphere", "--json"]
    assert main(["tradeoff", *arguments]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["model"] for row in rows] == ["exact", "sphere"]
    assert all(row["misses"] == row["outside_bound"] == 0 for row in rows)
    assert main(["tradeoff", "--scene", "clutter", "--model", "rabbit"]) == 2
    assert "expected one of auto, exact, sphere" in capsys.readouterr().err


def test_a_scene_without_steps_is_refused() -> None:
    with pytest.raises(InputError, match="at least one step"):
        model_tradeoff("none", OBJECTS, [], ["sphere"])
