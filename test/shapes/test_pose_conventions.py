"""Tests of poses from matrices, Euler angles and other orders of the quaternion, against SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from collision_monitor.errors import PoseError
from collision_monitor.shapes.pose import Pose

angle = st.floats(-4.0, 4.0)


@given(angle, angle, angle)
def test_euler_angles_are_about_fixed_axes_in_the_order_x_y_z(roll: float, pitch: float, yaw: float) -> None:
    pose = Pose.from_euler(roll, pitch, yaw, (1, 2, 3))
    expected = Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix()
    np.testing.assert_allclose(pose.rotation, expected, atol=1e-14)
    in_degrees = Pose.from_euler(*np.degrees([roll, pitch, yaw]), degrees=True)
    np.testing.assert_allclose(in_degrees.rotation, expected, atol=1e-13)


@given(angle, angle, angle)
def test_a_matrix_gives_back_its_pose(roll: float, pitch: float, yaw: float) -> None:
    pose = Pose.from_euler(roll, pitch, yaw, (1, 2, 3))
    back = Pose.from_matrix(pose.matrix)
    np.testing.assert_allclose(back.matrix, pose.matrix, atol=1e-14)
    np.testing.assert_allclose((pose @ pose.inverse()).matrix, np.eye(4), atol=1e-14)


@pytest.mark.parametrize("turn", [(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)])
def test_half_turns_lose_no_digits(turn: tuple[float, ...]) -> None:
    assert np.array_equal(np.abs(Pose.from_matrix(Pose((0, 0, 0), turn).rotation).quaternion), turn)


def test_w_comes_first_on_demand() -> None:
    assert Pose.from_wxyz((0, 0, 0), (0.5, 0.5, -0.5, 0.5)).quaternion.tolist() == [0.5, -0.5, 0.5, 0.5]


@pytest.mark.parametrize(
    ("matrix", "words"),
    [
        (np.eye(2), r"expected shape \(4, 4\) or \(3, 3\), got \(2, 2\)"),
        (np.diag([1.0, 1.0, -1.0]), "expected a rotation"),
        (2 * np.eye(3), "expected a rotation"),
        (np.full((3, 3), np.nan), "expected a rotation"),
        (np.ones((4, 4)), "expected the last row 0 0 0 1"),
        ("here", "expected numbers"),
    ],
)
def test_other_matrices_are_refused(matrix: object, words: str) -> None:
    with pytest.raises(PoseError, match=words):
        Pose.from_matrix(matrix)  # type: ignore[arg-type]
