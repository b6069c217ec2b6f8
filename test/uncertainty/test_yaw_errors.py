"""Errors of yaw alone move no upright solid of revolution, and no scene pays for axes that are exact."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import collision_monitor as cm
from collision_monitor.records import STATE, StateFlag

OFFSET = cm.Pose((0.0, 0.0, 0.4))


def people(flags: int, stddev: float, tilt: float = 0.0) -> NDArray[np.void]:
    """States of 40 upright bodies that walk and turn about z, with this error of orientation and its rate."""
    rng = np.random.default_rng(5)
    rows = np.zeros(40, STATE)
    rows["id"], rows["flags"] = np.arange(40), flags
    yaw = rng.uniform(-np.pi, np.pi, 40)
    rows["quaternion"][:, 2], rows["quaternion"][:, 3] = np.sin(yaw / 2), np.cos(yaw / 2)
    rows["quaternion"][:, 0] = np.sin(tilt / 2)
    rows["quaternion"] /= np.linalg.norm(rows["quaternion"], axis=1, keepdims=True)
    rows["position"][:, :2], rows["linear"][:, :2] = rng.uniform(-6, 6, (40, 2)), rng.normal(0, 1.2, (40, 2))
    rows["angular"][:, 2] = rng.normal(0, 0.5, 40)
    rows["position_stddev"], rows["velocity_stddev"] = 0.05, 0.1
    rows["orientation_stddev"] = rows["angular_velocity_stddev"] = stddev
    return rows


def answers(rows: NDArray[np.void], shapes: list[tuple[cm.Shape, cm.Pose]], **bounds: float) -> cm.StepResult:
    """Predictions of these bodies with the default profile."""
    monitor = cm.Monitor()
    for k in range(len(rows)):
        monitor.add(k, shapes, **bounds)
    return monitor.step(0, rows)


@pytest.mark.parametrize(
    "shapes",
    [
        [(cm.Cylinder(0.25, 1.7), cm.Pose())],
        [(cm.Cone(0.3, 1.7), cm.Pose())],
        [(cm.Capsule(0.25, 0.9), OFFSET), (cm.Sphere(0.4), cm.Pose())],
    ],
    ids=["cylinder", "cone", "capsule and ball"],
)
def test_an_upright_solid_of_revolution_is_not_moved_by_errors_of_yaw(shapes: list[tuple[cm.Shape, cm.Pose]]) -> None:
    exact = answers(people(StateFlag.YAW_ONLY, 0.0), shapes)
    by_yaw = answers(people(StateFlag.YAW_ONLY, 0.5), shapes)
    assert by_yaw.predictions.tobytes() == exact.predictions.tobytes()
    assert len(exact.predictions) > 20
    about_all = answers(people(0, 0.5), shapes)
    assert about_all.predictions.tobytes() != exact.predictions.tobytes()


@pytest.mark.parametrize(
    ("shape", "pose", "tilt"),
    [
        (cm.Box((0.5, 1.2, 1.7)), cm.Pose(), 0.0),
        (cm.Cylinder(0.25, 1.7), cm.Pose((0.3, 0.0, 0.0)), 0.0),
        (cm.Cylinder(0.25, 1.7), cm.Pose((0.0, 0.0, 0.0), (0.6, 0.0, 0.0, 0.8)), 0.0),
        (cm.Cylinder(0.25, 1.7), cm.Pose(), 0.5),
    ],
    ids=["box", "beside the axis", "lying in its body", "leaning"],
)
def test_errors_of_yaw_move_every_other_body(shape: cm.Shape, pose: cm.Pose, tilt: float) -> None:
    shapes = [(shape, pose)]
    exact = answers(people(StateFlag.YAW_ONLY, 0.0, tilt), shapes).predictions
    by_yaw = answers(people(StateFlag.YAW_ONLY, 0.3, tilt), shapes).predictions
    assert by_yaw.tobytes() != exact.tobytes()


def test_a_bound_on_the_angular_acceleration_has_any_axis() -> None:
    shapes = [(cm.Cylinder(0.25, 1.7), cm.Pose())]
    by_yaw = answers(people(StateFlag.YAW_ONLY, 0.2), shapes, max_angular_acceleration=0.5).predictions
    about_all = answers(people(0, 0.2), shapes, max_angular_acceleration=0.5).predictions
    assert by_yaw.tobytes() == about_all.tobytes()


def test_a_flat_scene_and_the_same_in_space_agree() -> None:
    """Boxes whose yaw is uncertain, as polygons in the plane."""
    rows = people(StateFlag.YAW_ONLY, 0.1)
    space = answers(rows, [(cm.Box((0.5, 1.2, 1.7)), cm.Pose())]).predictions
    corners = np.array([(-0.25, -0.6), (0.25, -0.6), (0.25, 0.6), (-0.25, 0.6)])
    flat = answers(rows, [(cm.Polygon(corners), cm.Pose())]).predictions
    both = {(int(row["id_a"]), int(row["id_b"])): float(row["probability"]) for row in flat}
    found = {(int(row["id_a"]), int(row["id_b"])): float(row["probability"]) for row in space}
    assert len(both) > 20
    for pair in both.keys() | found.keys():
        assert found.get(pair, 0.0) == pytest.approx(both.get(pair, 0.0), abs=0.03)
