"""Arguments of the batches: N shapes and N poses as arrays that a kernel reads."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import accumulate
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError, PoseError, ShapeError
from collision_monitor.geometry.coordinates import real_array
from collision_monitor.query.arguments import Compound
from collision_monitor.query.packed import packed_shape
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Shape
from collision_monitor.tolerances import LARGEST_INPUT, UNIT_QUATERNION

Array = NDArray[np.float64]
Shapes = Compound | Sequence[Compound]
Progress = Callable[[int], None]

AT_ONCE: Final = 1 << 14
"""Pairs of one call of a kernel, between two reports of progress: 5 to 50 ms."""


LARGE: Final = 32
"""Mean size of packed shapes from which repeated ones are found, which takes longer than copying small ones."""


class PackedShapes(NamedTuple):
    """N shapes, or one for all pairs."""

    rows: Array  # the different packed shapes, one after the other
    at: NDArray[np.int64]  # (N,) or (1,): where each begins; -1: no convex solid, see `shapes`
    shapes: Sequence[Compound]  # (N,) or (1,)

    def __len__(self) -> int:
        return len(self.shapes)

    def of(self, k: int) -> Compound:
        """Shape of pair k."""
        return self.shapes[k if len(self.shapes) > 1 else 0]


def pack_shapes(value: Shapes, name: str) -> PackedShapes:
    """Pack a shape, a compound (a list of (shape, pose)), or a list of N shapes and compounds. Raises ShapeError."""
    shapes: Sequence[Any] = [value] if isinstance(value, Shape) else value if isinstance(value, Sequence) else []
    if len(shapes) and isinstance(shapes[0], tuple):
        shapes = [shapes]  # one compound
    if not len(shapes):
        raise ShapeError(f"{name}: expected a shape, a compound or a list of them, got {value!r}")
    rows = [getattr(shape, "packed_shape", None) for shape in shapes]
    for k in [k for k, row in enumerate(rows) if row is None]:
        found = getattr(shapes[k], "packed_shape", None)  # an equal object may come again
        rows[k] = packed_shape(shapes[k]) if found is None else found
    kept = [row for row in rows if row is not None]
    sizes = np.fromiter((0 if row is None else len(row) for row in rows), np.int64, len(rows))
    if sizes.sum() > LARGE * len(rows):  # hulls: each different one once
        kept = list({id(row): row for row in kept}.values())
        begin = dict(zip(map(id, kept), accumulate(map(len, kept), initial=0), strict=False))
        at = np.array([-1 if row is None else begin[id(row)] for row in rows])
    else:
        at = np.where(sizes > 0, np.cumsum(sizes) - sizes, -1)
    return PackedShapes(np.concatenate(kept or [np.zeros(0)]), at, shapes)


def pose_rows(value: Any, name: str) -> Array:
    """Poses as rows (N, 7) with unit quaternions: of a Pose, a list of Pose, or an array (N, 7). Raises PoseError."""
    if isinstance(value, Pose):
        value = [value]
    if isinstance(value, Sequence) and len(value) and all(isinstance(pose, Pose) for pose in value):
        return np.array([np.concatenate([pose.position, pose.quaternion]) for pose in value])
    rows = number_rows(value, 7, name)
    norm = np.sqrt(np.einsum("ni,ni->n", rows[:, 3:], rows[:, 3:]))
    bad = np.flatnonzero(~(np.abs(norm - 1.0) <= UNIT_QUATERNION))
    if len(bad):
        raise PoseError(
            f"{name}: expected quaternions of unit length within {UNIT_QUATERNION:g}, "
            f"got one of length {norm[bad[0]]:g} in row {bad[0]}"
        )
    rows[:, 3:] /= norm[:, None]
    return rows


def pose_of(row: Array) -> Pose:
    """Pose of a row of `pose_rows` to the bit: normalising its quaternion again could change the last one."""
    return Pose.of_numbers(row[:7].tolist())


def number_rows(value: Any, width: int, name: str) -> Array:
    """Copy of an array (N, width) of finite numbers; one row may lack its dimension. Raises InputError, PoseError."""
    try:
        rows = np.atleast_2d(np.array(real_array(value)))
    except (TypeError, ValueError):
        raise InputError(f"{name}: expected numbers (N, {width}), got {type(value).__name__}") from None
    if rows.ndim != 2 or rows.shape[1] != width:
        raise InputError(f"{name}: expected an array (N, {width}), got shape {np.shape(value)}")
    bad = np.flatnonzero(~(np.abs(rows) <= LARGEST_INPUT).all(axis=1))
    if len(bad):
        raise PoseError(f"{name}: expected finite numbers up to {LARGEST_INPUT:g}, got others in row {bad[0]}")
    return np.ascontiguousarray(rows)


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


def part(values: Array | NDArray[np.int64], which: slice) -> Any:
    """Rows of an argument for these pairs; one row applies to all."""
    return values[which] if len(values) > 1 else values
