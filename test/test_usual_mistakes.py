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
    "two numbers as pose": (lambda: cm.contact(BOX, (0, 0), BALL, HERE), cm.PoseError, "a Pose, (x, y, z), 7 numbers"),
    "a rotation as pose": (lambda: cm.contact(BOX, np.eye(3), BALL, HERE), cm.PoseError, "or a matrix (4, 4)"),
    "seven zeros as pose": (lambda: cm.overlap(BOX, HERE, BALL, np.zeros(7)), cm.PoseError, "pose B: quaternion"),
    "shapes before poses": (lambda: cm.contact(BOX, BALL, HERE, HERE), cm.PoseError, "shape_a, pose_a, shape_b"),
    "a pose that would be lost": (lambda: _monitor().add(2, BALL, pose=HERE), cm.InputError, "write static=True"),
    "a pose as motion": (lambda: cm.time_of_impact(BOX, HERE, BALL, HERE), cm.PoseError, "write Motion(pose)"),
    "shapes without poses": (lambda: _monitor().add(2, [BOX, BALL]), cm.ShapeError, "write [(shape, Pose()), …]"),
    "a known id": (lambda: _monitor().add(1, BALL), cm.InputError, "write replace=True"),
    "seconds": (lambda: _monitor().step(0.1, [1], np.zeros((1, 7))), cm.InputError, "write round(1e9 * t), or stamp=t"),
    "positions as poses": (lambda: _monitor().step(0, [1], [(0, 0, 0)]), cm.InputError, "x y z qx qy qz qw"),
    "a profile's name": (lambda: cm.Monitor("fsat"), cm.ProfileError, "balanced, exact, fast"),
    "a number as profile": (lambda: cm.Monitor(3), cm.ProfileError, "balanced, exact, fast"),
    "no profile": (lambda: setattr(_monitor(), "profile", None), cm.ProfileError, "balanced, exact, fast"),
    "no settings": (lambda: cm.Profile.from_dict(None), cm.ProfileError, "expected settings by name, got None"),
    "a setting beyond floats": (lambda: cm.Profile(horizon=10**400), cm.ProfileError, "horizon: expected"),
    "a text as now_ns": (lambda: _monitor().step(0, [], now_ns="x"), cm.InputError, "now_ns: expected an integer"),
    "seconds as now_ns": (lambda: _monitor().step(0, [], now_ns=0.5), cm.InputError, "write round(1e9 * t)"),
    "a stamp beyond 64 bits": (lambda: _monitor().step(10**400, []), cm.InputError, "64 bits"),
    "now beyond 64 bits": (lambda: _monitor().step(0, [], now_ns=-(10**400)), cm.InputError, "64 bits"),
    "a shape as description": (lambda: _monitor().describe(BALL), cm.InputError, "use add(id, shape)"),
    "ids to remove": (lambda: _monitor().remove([1]), cm.InputError, "expected the id of an object"),
    "no allowed ids": (lambda: _monitor().add(2, BALL, allowed=None), cm.InputError, "expected a list of ids"),
    "ids as id": (lambda: _monitor().add(np.arange(2), BALL), cm.InputError, "expected an integer from 0"),
    "a padding beyond floats": (lambda: _monitor().add(2, BALL, padding=10**400), cm.InputError, "padding"),
    "a radius beyond floats": (lambda: cm.Sphere(10**400), cm.ShapeError, "positive number of metres"),
    "a number beyond floats": (lambda: cm.Pose((10**400, 0, 0)), cm.PoseError, "position: expected 3 numbers"),
    "poses beyond floats": (lambda: _monitor().step(0, [1], [[10**400] * 7]), cm.InputError, "arrays of numbers"),
    "rows of a pose": (lambda: cm.contact(BOX, [[0, 0, 0], [1]], BALL, HERE), cm.PoseError, "expected a Pose, (x, y,"),
    "an array as shape": (lambda: cm.contact(np.array(1.0), HERE, BALL, HERE), cm.ShapeError, "list of (shape, pose)"),
    "no contact": (lambda: cm.contact_features(None, BOX, HERE, BOX, HERE), cm.InputError, "the result of `contact`"),
    "no pose": (
        lambda: cm.contact_features(cm.contact(BOX, HERE, BOX, HERE), BOX, None, BOX, HERE),
        cm.PoseError,
        "pose A: expected a Pose",
    ),
    "a list as test": (lambda: cm.overlap(BOX, HERE, BALL, HERE, []), cm.InputError, "test: expected one of"),
    "a list as method": (
        lambda: cm.time_of_impact(BOX, cm.Motion(HERE), BALL, cm.Motion(HERE), method=[]),
        cm.InputError,
        "method: expected one of",
    ),
    "a text as length": (
        lambda: cm.cast_ray(BOX, HERE, (0, 0, 2), (0, 0, -1), "far"),
        cm.InputError,
        "length: expected metres",
    ),
    "a box to decompose": (lambda: cm.convex_decomposition(BOX, 0.1), cm.ShapeError, "expected a Mesh"),
    "no path": (lambda: cm.load_mesh(None), cm.ShapeError, "expected the path of a file"),
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
