"""Arguments of the batches: N shapes and N poses as arrays that a kernel reads."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.checks.numbers import checked_rows, real_array
from collision_monitor.errors import InputError, PoseError, ShapeError
from collision_monitor.meshes.trees.shape_trees import CERTAIN
from collision_monitor.query.body import kept_slots, plant
from collision_monitor.shapes.compound import Compound
from collision_monitor.shapes.matrix_to_pose import matrices_to_poses
from collision_monitor.shapes.pose import Pose, as_pose
from collision_monitor.shapes.registry import Shape
from collision_monitor.tolerances import LARGEST_INPUT, NORMALISED, UNIT_QUATERNION

Array = NDArray[np.float64]
Shapes = Compound | Sequence[Compound]
Progress = Callable[[int], None]

AT_ONCE: Final = 1 << 14
"""Pairs of one call of a kernel, between two reports of progress: 5 to 50 ms."""


class BatchShapes(NamedTuple):
    """N shapes, or one for all pairs, in the library. Each array is (N,) or (1,)."""

    shapes: Sequence[Compound]
    first: NDArray[np.int32]  # its slot; -1: only a single query answers it, as for compounds and some meshes
    is_convex: NDArray[np.bool_]
    is_bounded: NDArray[np.bool_]
    has_mesh: bool  # one of them

    def __len__(self) -> int:
        return len(self.shapes)

    def of(self, k: int) -> Compound:
        """Shape of pair k."""
        return self.shapes[k if len(self.shapes) > 1 else 0]

    def plant(self) -> None:
        """Give the convex pieces of all shapes the trees that pairs with meshes need."""
        for shape in self.shapes:
            if isinstance(shape, Shape) and (kept := kept_slots(shape)) and not kept.is_planted:
                plant(kept, shape)


def batch_shapes(value: Shapes, name: str) -> BatchShapes:
    """Lay out a shape, a compound (a list of (shape, pose)), or a list of N shapes and compounds. Raises ShapeError."""
    shapes: Sequence[Any] = [value] if isinstance(value, Shape) else value if isinstance(value, Sequence) else []
    if len(shapes) and isinstance(shapes[0], tuple):
        shapes = [shapes]  # one compound
    if not len(shapes):
        raise ShapeError(f"{name}: expected a shape, a compound or a list of them, got {value!r}")
    kept = [kept_slots(shape) for shape in shapes]
    count = len(kept)
    known = [each for each in kept if each is not None]
    first = np.fromiter((each.first if each and each.inside == CERTAIN else -1 for each in kept), np.int32, count)
    is_convex = np.fromiter((each is not None and each.is_convex for each in kept), np.bool_, count)
    is_bounded = np.fromiter((each is None or each.is_bounded for each in kept), np.bool_, count)
    return BatchShapes(shapes, first, is_convex, is_bounded, any(each.has_mesh for each in known))


def pose_rows(value: Any, name: str) -> Array:
    """Poses as rows (N, 7) with unit quaternions. Raises PoseError.

    value: one for all pairs, as `as_pose` takes it, a list of N, or an array (N, 7), (N, 3) of positions or (N, 4, 4).
    """
    if isinstance(value, Pose):
        return np.array([value.numbers])
    if isinstance(value, Sequence) and len(value) and any(isinstance(pose, Pose) for pose in value):
        return np.array([as_pose(pose, f"{name}, {k}").numbers for k, pose in enumerate(value)])
    try:
        found = real_array(value)
    except (TypeError, ValueError, OverflowError):
        got = type(value).__name__
        raise PoseError(f"{name}: expected poses as rows (N, 7), or a list of Pose, got {got}") from None
    if found.shape[-2:] == (4, 4):
        matrices = np.array(found.reshape(-1, 4, 4), order="C")
        rows = np.empty((len(matrices), 7))
        wrong = matrices_to_poses(matrices, rows)
        return rows if wrong < 0 else np.array([as_pose(matrices[wrong], f"{name}, {wrong}").numbers])
    if found.ndim in (1, 2) and found.shape[-1] == 3:
        found = np.concatenate([np.atleast_2d(found), np.tile([0.0, 0.0, 0.0, 1.0], (found.size // 3, 1))], axis=1)
    rows = checked_rows(found, 7, name, LARGEST_INPUT, PoseError)
    norm = np.sqrt(np.einsum("ni,ni->n", rows[:, 3:], rows[:, 3:]))
    bad = np.flatnonzero(~(np.abs(norm - 1.0) <= UNIT_QUATERNION))
    if len(bad):
        raise PoseError(
            f"{name}: expected quaternions of unit length within {UNIT_QUATERNION:g}, "
            f"got one of length {norm[bad[0]]:g} in row {bad[0]}"
        )
    rows[:, 3:] /= np.where(np.abs(norm - 1.0) <= NORMALISED, 1.0, norm)[:, None]
    return rows


def pose_of(row: Array) -> Pose:
    """Pose of a row of `pose_rows` to the bit: normalising its quaternion again could change the last one."""
    return Pose.of_numbers(row[:7].tolist())


def pair_count(**lengths: int) -> int:
    """The one length of arguments with a length other than 1. Raises InputError if they differ."""
    others = {name: n for name, n in lengths.items() if n != 1}
    if len(set(others.values())) > 1:
        got = ", ".join(f"{name} {n}" for name, n in others.items())
        raise InputError(f"expected one length of all arguments, or 1 for one that applies to all pairs; got {got}")
    return next(iter(others.values()), 1)


def pair_ranges(count: int, progress: Progress | None) -> Iterator[slice]:
    """The pairs in parts of AT_ONCE; report the number that are done after each."""
    for begin in range(0, count, AT_ONCE):
        end = min(begin + AT_ONCE, count)
        yield slice(begin, end)
        if progress is not None:
            progress(end)


def part(values: Array | NDArray[np.int32], which: slice) -> Any:
    """Rows of an argument for these pairs; one row applies to all."""
    return values[which] if len(values) > 1 else values
