"""The feature of a shape at a point of its surface: a vertex, an edge or a face, with its number."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import UnsupportedError
from collision_monitor.geometry.contact_features import Feature
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import KINDS, Shape, kind_of
from collision_monitor.shapes.revolved import ROUND_TIE
from collision_monitor.tolerances import FEATURE_TIE

Array = NDArray[np.float64]


def shape_tie(shape_a: object, shape_b: object) -> float:
    """Largest difference of equal heights, relative, for the witness points of two shapes or compounds."""
    curved = any(isinstance(shape, Shape) and kind_of(shape).curved for shape in (shape_a, shape_b))
    return ROUND_TIE if curved else FEATURE_TIE


def feature_of(shape: Shape, pose: Pose, point: Array, normal: Array, tie: float, off: float) -> Feature:
    """Feature of a shape at a point (3,) in m with an outward normal (3,), both in the world frame.

    Numbered as in `contact_features`, with the same errors. tie: largest difference of equal heights, relative.
    off: error of the point (m).
    """
    if (feature := kind_of(shape).feature) is None:
        named = ", ".join(kind.shape.__name__ for kind in KINDS if kind.feature is not None)
        raise UnsupportedError(f"{type(shape).__name__} has no vertices, edges and faces; supported are {named}")
    return feature(shape, (point - pose.position) @ pose.rotation, normal @ pose.rotation, tie, off)
