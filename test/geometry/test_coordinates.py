"""Numbers at every door of the API: what NumPy converts in silence, and loses a part of, is refused."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import collision_monitor as cm
from collision_monitor.broad_phase.boxes import box_arrays
from collision_monitor.checks.numbers import real_array, real_number
from collision_monitor.detection.detector import Detector
from collision_monitor.errors import InputError
from collision_monitor.geometry.orientation import orient2d
from collision_monitor.geometry.points import point_distance
from collision_monitor.records import STATE

CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])


def masked(value: np.ndarray) -> np.ndarray:
    """The same numbers, the last of which is hidden: it may be anything."""
    mask = np.zeros(value.shape, bool)
    mask.reshape(-1)[-1] = True
    return np.ma.array(value, mask=mask)


LOSSY: dict[str, Callable[[np.ndarray], Any]] = {
    "masked": masked,
    "rows masked": lambda value: list(map(masked, value)) if value.ndim > 1 else masked(value),
    "complex": lambda value: value.astype(complex),
    "complex scalars": lambda value: [np.complex128(each) for each in value] if value.ndim == 1 else value + 0j,
    "texts": lambda value: value.astype(str),
    "bytes": lambda value: value.astype(np.bytes_),
    "texts in a list": lambda value: value.astype(str).tolist(),
    "durations": lambda value: value.astype("m8[ns]"),
    "objects with a text": lambda value: np.array([*value.astype(object).tolist()[:-1], "1"], dtype=object),
}

detector = Detector([cm.Sphere(1)])

POSE, ZERO, ONE = cm.Pose(), np.zeros(3), np.ones(3)
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
ROWS = np.array([[0.0, 0, 0, 0, 0, 0, 1]])


def step(ids: Any = (1,), poses: Any = ROWS, twists: Any = None, covariance: Any = None) -> Any:
    monitor = cm.Monitor()
    monitor.add(1, cm.Sphere(1))
    return monitor.step(0, ids, poses, twists, covariance=covariance)


DOORS: dict[str, tuple[Callable[[Any], Any], np.ndarray]] = {
    "Box": (cm.Box, ONE),
    "Ellipsoid": (cm.Ellipsoid, ONE),
    "ConvexHull": (cm.ConvexHull, CUBE),
    "Polygon": (cm.Polygon, np.array([[0.0, 0], [1, 0], [0, 1]])),
    "Points": (lambda value: cm.Points(value, 0.1), CUBE),
    "Mesh": (lambda value: cm.Mesh(value, [[0, 1, 2]]), CUBE),
    "HalfSpace": (lambda value: cm.HalfSpace(value, 0.0), ONE),
    "position": (cm.Pose, ONE),
    "quaternion": (lambda value: cm.Pose((0, 0, 0), value), IDENTITY),
    "matrix": (cm.Pose.from_matrix, np.eye(4)),
    "w x y z": (lambda value: cm.Pose.from_wxyz((0, 0, 0), value), np.array([1.0, 0, 0, 0])),
    "linear velocity": (lambda value: cm.Motion(POSE, linear=value), ONE),
    "acceleration": (lambda value: cm.Motion(POSE, acceleration=value), ONE),
    "poses of a step": (lambda value: step(poses=value), ROWS),
    "twists of a step": (lambda value: step(twists=value), np.zeros((1, 6))),
    "covariance of a step": (lambda value: step(covariance=value), np.zeros((1, 12))),
    "poses of a batch": (lambda value: cm.contacts(cm.Sphere(1), value, cm.Sphere(1), value), ROWS),
    "points of contains": (lambda value: cm.contains(cm.Sphere(1), POSE, value), ONE),
    "ray": (lambda value: cm.cast_ray(cm.Sphere(1), POSE, value, (0, 0, 1)), ONE),
    "features": (cm.vertex_face_impact, np.zeros((8, 3))),
    "points": (lambda value: point_distance(value, value), CUBE),
    "orientation": (lambda value: orient2d(value, value, value), np.zeros((4, 2))),
    "positions of a frame": (lambda value: detector.detect(value, IDENTITY[None]), np.zeros((1, 3))),
    "quaternions of a frame": (lambda value: detector.detect(np.zeros((1, 3)), value), IDENTITY[None]),
    "sizes of spheres": (lambda value: cm.world.HardSpheres(4, 0.1, radii=value), np.full(4, 0.5)),
    "boxes": (lambda value: box_arrays(value, value), CUBE),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", LOSSY)
@pytest.mark.parametrize("door", DOORS)
def test_numbers_that_would_lose_a_part_are_refused(door: str, kind: str) -> None:
    take, good = DOORS[door]
    take(good)
    with pytest.raises(InputError):
        take(LOSSY[kind](good))


SCALARS: dict[str, Any] = {
    "complex": 1 + 0j,
    "a complex scalar": np.complex128(1 + 2j),
    "masked": np.ma.masked,
    "masked array": np.ma.array(1.0, mask=True),
    "text": "1",
    "duration": np.timedelta64(1, "s"),
    "array": np.ones(2),
    "none": None,
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", SCALARS)
def test_one_number_that_would_lose_a_part_is_refused(kind: str) -> None:
    for take in (
        cm.Sphere,
        lambda value: cm.Capsule(0.1, value),
        lambda value: cm.HalfSpace((0, 0, 1), value),
        lambda value: cm.Points(CUBE, value),
        lambda value: cm.time_of_impact(cm.Sphere(1), cm.Motion(POSE), cm.Sphere(1), cm.Motion(POSE), horizon=value),
        lambda value: cm.Monitor().add(1, cm.Sphere(1), padding=value),
    ):
        with pytest.raises(InputError):
            take(SCALARS[kind])


@pytest.mark.parametrize(
    "value", [np.ma.array([1], dtype=np.uint32, mask=[True]), np.ma.array(np.zeros(1, STATE), mask=True)]
)
def test_masked_ids_and_states_are_refused(value: Any) -> None:
    with pytest.raises(InputError, match="ids: expected one dimension of integers"):
        step(ids=value)
    with pytest.raises(InputError, match="faces"):
        cm.Mesh(CUBE, np.ma.array([[0, 1, 2]], mask=[[False, False, True]]))


def test_all_kinds_of_real_numbers_are_taken() -> None:
    for kind in ("i1", "u8", "f2", "f4", ">f8", "?", object):
        np.testing.assert_array_equal(real_array(np.ones((2, 3), kind)), 1.0)
    assert real_array([Fraction(1, 2), Decimal("0.25"), 1]).tolist() == [0.5, 0.25, 1.0]
    assert real_array(np.ma.array([1.0, 2.0], mask=False)).tolist() == [1.0, 2.0]
    array = np.zeros(3)
    assert real_array(array) is array
    assert [real_number(each) for each in (1, 2.0, np.float32(3), np.int8(4), Fraction(5), np.array(6))] == [
        1,
        2,
        3,
        4,
        5,
        6,
    ]
