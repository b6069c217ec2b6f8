"""Full detection: computes all contacts of a frame from all poses.

    Detector(shapes).detect(positions, quaternions) -> DetectedContacts

For scenes in which every pose is new in each frame. Monitor, in contrast, keeps state and predicts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.broad_phase.dense_grid import classify_bodies, make_grid
from collision_monitor.checks.numbers import as_numbers
from collision_monitor.detection import kernels
from collision_monitor.detection.partitioned import check_broad_phase, detect_with
from collision_monitor.errors import InputError, PoseError, UnsupportedError
from collision_monitor.shapes.kinds.box import BOX
from collision_monitor.shapes.kinds.sphere import SPHERE
from collision_monitor.shapes.planar import is_planar
from collision_monitor.shapes.registry import Shape
from collision_monitor.shapes.shape_table import ShapeTableBuilder
from collision_monitor.tolerances import LARGEST_INPUT, UNIT_QUATERNION

Array = NDArray[np.float64]

WORTH_THREADS: Final = 3000
"""Number of objects from which a second thread pays; a smaller frame is finished before that thread has woken up."""


def default_threads() -> int:
    """Return 2, or 1 on a machine with a single core."""
    return min(2, int(numba.config.NUMBA_NUM_THREADS))


@dataclass(frozen=True, slots=True, eq=False)
class DetectedContacts:
    """M contacts, sorted by pair. `table` holds one row for each, and the other fields are views of it."""

    pairs: NDArray[np.int32]
    """(M, 2): indices of the two shapes A and B, the smaller first."""
    table: Array
    """(M, 14): signed distance, error bound, normal, point, point on A, point on B (see kernels.DETECTED)."""

    def __len__(self) -> int:
        return len(self.pairs)

    def _field(self, name: str) -> Array:
        return self.table.view(kernels.DETECTED)[name][:, 0]

    @property
    def signed_distance(self) -> Array:
        """(M,) m: minus the depth where the shapes overlap."""
        return self._field("signed_distance")

    @property
    def error_bound(self) -> Array:
        """(M,) m: largest error of the signed distance."""
        return self._field("error_bound")

    @property
    def normal(self) -> Array:
        """(M, 3): unit vector from A to B; B moved along it by the depth touches A."""
        return self._field("normal")

    @property
    def point(self) -> Array:
        """(M, 3) m: the middle between the witness points."""
        return self._field("point")

    @property
    def point_a(self) -> Array:
        """(M, 3) m: the witness point on A, in the world."""
        return self._field("point_a")

    @property
    def point_b(self) -> Array:
        """(M, 3) m: the witness point on B, in the world."""
        return self._field("point_b")


class Detector:
    """Detector of every pair of shapes with a distance of at most `margin` (m).

    shapes: one for each object. static: (N,) flags; pairs of two static objects are ignored.
    threads: largest number of threads for a frame; the result is the same to the bit for any number.
    broad_phase: "grid", or a slower one for comparison (`partitioned.BROAD_PHASES`), which runs on one thread.
    Raises ShapeError, UnsupportedError (a shape without narrow phase) or InputError.
    """

    def __init__(
        self,
        shapes: Sequence[Shape],
        *,
        static: ArrayLike | None = None,
        margin: float = 0.0,
        threads: int = 1,
        broad_phase: str = "grid",
    ) -> None:
        n = len(shapes)
        if not (np.isfinite(margin) and margin >= 0.0):
            raise InputError(f"margin: expected a finite number of metres >= 0, got {margin!r}")
        if not 1 <= threads <= numba.config.NUMBA_NUM_THREADS:
            most = numba.config.NUMBA_NUM_THREADS
            raise InputError(f"threads: expected 1 to {most}, got {threads!r}")
        resting = np.zeros(n, np.bool_) if static is None else np.asarray(static, dtype=np.bool_)
        if resting.shape != (n,):
            raise InputError(f"static: expected {n} flags, one for each shape, got an array of shape {resting.shape}")
        builder = ShapeTableBuilder(slots=n)
        for shape in shapes:
            if is_planar(shape):
                raise UnsupportedError(f"{type(shape).__name__}: the detector is for shapes of space; use Monitor")
            builder.append(shape)
        self._n = n
        self._table = builder.table
        kinds = set(self._table.kind[:n].tolist())
        self._path = {(SPHERE,): kernels.SPHERES, (BOX,): kernels.BOXES}.get(tuple(kinds), kernels.ANY)
        if self._path == kernels.BOXES and margin > 0.0:
            self._path = kernels.ANY  # SAT alone gives no distance of boxes that are apart
        self._margin = float(margin)
        self._threads = threads if n >= WORTH_THREADS else 1
        # half of the margin for each body; rounded up, so that no pair at the margin is lost
        radius = (self._table.radius[:n] + 0.5 * margin) * (1.0 + 1e-15)
        body = np.column_stack([self._table.size[:n, :3], radius])
        if self._path == kernels.SPHERES:
            body[:, 0] += self._table.margin[:n]
        self._frame = kernels.make_frame(body, self._threads)
        self._grid = make_grid(n)
        classify_bodies(radius, ~resting, self._grid)
        self._hits = kernels.make_hits(self._threads, max(n, 16))
        self._memory = (*self._table, *self._grid, *self._frame, *self._hits)
        self._room = max(n // 2, 16)
        self._broad_phase = check_broad_phase(broad_phase, n)
        self._radius, self._movable = radius, ~resting

    def __len__(self) -> int:
        return self._n

    def detect(self, positions: ArrayLike, quaternions: ArrayLike) -> DetectedContacts:
        """Contacts at these positions (N, 3) m and unit quaternions (N, 4) x, y, z, w.

        Raises InputError for arrays of another shape, PoseError for values that are not finite or not of unit length.
        """
        positions = np.ascontiguousarray(as_numbers(positions, "positions"))
        quaternions = np.ascontiguousarray(as_numbers(quaternions, "quaternions"))
        n = self._n
        if positions.shape != (n, 3) or quaternions.shape != (n, 4):
            raise InputError(
                f"expected positions of shape ({n}, 3) and quaternions of shape ({n}, 4), "
                f"got {positions.shape} and {quaternions.shape}"
            )
        if self._broad_phase != "grid":
            if not _is_valid(positions, quaternions).all():
                raise PoseError(_what_is_wrong(positions, quaternions))
            return DetectedContacts(
                *detect_with(
                    self._broad_phase, self._table, self._radius, self._movable, self._margin, positions, quaternions
                )
            )
        if self._threads > 1:
            numba.set_num_threads(self._threads)
            run = kernels.detect_parallel
        else:
            run = kernels.detect
        while True:
            pairs = np.empty((self._room, 2), np.int32)
            table = np.empty((self._room, kernels.DETECTED_SIZE))
            count = run(self._path, self._margin, positions, quaternions, pairs, table, *self._memory)
            if count >= 0:
                return DetectedContacts(pairs[:count], table[:count])
            if count >= kernels.BAD_QUATERNION:
                raise PoseError(_what_is_wrong(positions, quaternions))
            # more contacts than in any frame before: allocate more memory and repeat the frame
            needed = kernels.BAD_QUATERNION - 1 - count
            self._room = needed + needed // 4
            self._hits = kernels.make_hits(self._threads, self._room)
            self._memory = (*self._table, *self._grid, *self._frame, *self._hits)


def _is_valid(positions: Array, quaternions: Array) -> NDArray[np.bool_]:
    """Mask (N,) of the rows that are valid poses."""
    near = (np.abs(positions) <= LARGEST_INPUT).all(axis=1)
    return np.asarray(near & (np.abs(np.linalg.norm(quaternions, axis=1) - 1.0) <= UNIT_QUATERNION))


def _what_is_wrong(positions: Array, quaternions: Array) -> str:
    """Describe the first row that is not a valid pose."""
    far = ~(np.abs(positions) <= LARGEST_INPUT).all(axis=1)
    if far.any():
        i = int(np.argmax(far))
        return f"positions[{i}]: expected finite numbers up to {LARGEST_INPUT:g} m, got {positions[i].tolist()}"
    bad = ~(np.abs(np.linalg.norm(quaternions, axis=1) - 1.0) <= UNIT_QUATERNION)
    i = int(np.argmax(bad))
    return f"quaternions[{i}]: expected unit length within {UNIT_QUATERNION:g}, got {quaternions[i].tolist()}"
