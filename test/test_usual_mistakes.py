"""The usual mistakes of first users: each error says what to write."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import collision_monitor as cm

BOX, BALL, HERE = cm.Box((1, 1, 1)), cm.Sphere(0.5), cm.Pose()


def _monitor() -> cm.Monitor:
    monitor = cm.Monitor()
    monitor.add(1, BOX)
    return monitor


MISTAKES: dict[str, tuple[Callable[[], object], type[Exception], str]] = {
    "three extents": (lambda: cm.Box(1, 1, 1), cm.ShapeError, "write Box((x, y, z))"),
    "three coordinates": (lambda: cm.Pose(1, 2, 3), cm.PoseError, "write Pose((x, y, z))"),
    "a matrix": (lambda: cm.Pose(np.eye(4)), cm.PoseError, "write Pose.from_matrix(matrix)"),
    "angles": (lambda: cm.Pose((0, 0, 0), (0, 0, 1.57)), cm.PoseError, "write Pose.from_euler(roll, pitch, yaw)"),
    "a tuple as pose": (lambda: cm.contact(BOX, (0, 0, 0), BALL, HERE), cm.PoseError, "write Pose((x, y, z))"),
    "a matrix as pose": (lambda: cm.contact(BOX, np.eye(4), BALL, HERE), cm.PoseError, "Pose.from_matrix(matrix)"),
    "seven numbers as pose": (lambda: cm.overlap(BOX, HERE, BALL, np.zeros(7)), cm.PoseError, "Pose((x, y, z), ("),
    "shapes before poses": (lambda: cm.contact(BOX, BALL, HERE, HERE), cm.PoseError, "shape_a, pose_a, shape_b"),
    "a pose that would be lost": (lambda: _monitor().add(2, BALL, pose=HERE), cm.InputError, "write static=True"),
    "a pose as motion": (lambda: cm.time_of_impact(BOX, HERE, BALL, HERE), cm.PoseError, "write Motion(pose)"),
    "shapes without poses": (lambda: _monitor().add(2, [BOX, BALL]), cm.ShapeError, "write [(shape, Pose()), …]"),
    "a known id": (lambda: _monitor().add(1, BALL), cm.InputError, "write replace=True"),
    "a name as id": (lambda: _monitor().add("robot", BOX), cm.InputError, "name="),
    "seconds": (lambda: _monitor().step(0.1, [1], np.zeros((1, 7))), cm.InputError, "write round(1e9 * t)"),
    "positions as poses": (lambda: _monitor().step(0, [1], [(0, 0, 0)]), cm.InputError, "x y z qx qy qz qw"),
    "a profile's name": (lambda: cm.Monitor("fsat"), cm.ProfileError, "balanced, exact, fast"),
    "a number as profile": (lambda: cm.Monitor(3), cm.ProfileError, "balanced, exact, fast"),
}


@pytest.mark.parametrize(("attempt", "error", "text"), MISTAKES.values(), ids=MISTAKES)
def test_the_error_of_a_usual_mistake_says_what_to_write(
    attempt: Callable[[], object], error: type[Exception], text: str
) -> None:
    with pytest.raises(error) as caught:
        attempt()
    assert text in str(caught.value)


def test_a_misspelt_field_of_a_contact_carries_what_python_needs() -> None:
    contact = cm.contact(BOX, HERE, BALL, HERE)
    with pytest.raises(AttributeError, match=r"^'Contact' object has no attribute 'signed_distnace'$") as caught:
        contact.signed_distnace  # noqa: B018
    assert caught.value.name == "signed_distnace" and caught.value.obj is contact


def test_a_refused_state_names_the_field_that_is_not_finite() -> None:
    monitor = _monitor()
    pose = [0, float("nan"), 0, 0, 0, 0, 1]
    with pytest.warns(cm.RefusalWarning, match=r"got position \[0.0, nan, 0.0\] \("):
        monitor.step(0, [1], [pose])


def test_a_monitor_says_what_it_holds() -> None:
    monitor = _monitor()
    assert repr(monitor) == "Monitor('balanced', 1 objects, no step yet)"
    monitor.step(7, [1], [(0, 0, 0, 0, 0, 0, 1)])
    assert repr(monitor) == "Monitor('balanced', 1 objects, step 1 at 7 ns)"


def test_a_misspelt_name_carries_what_python_needs_to_suggest_the_right_one() -> None:
    with pytest.raises(AttributeError) as caught:
        cm.Shpere  # noqa: B018
    assert caught.value.name == "Shpere" and caught.value.obj is cm
