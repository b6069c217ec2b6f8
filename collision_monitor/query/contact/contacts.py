"""`contacts`: `contact` for arrays of pairs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor.impact.body_contact import RESULT
from collision_monitor.impact.mesh_pair import SOLIDS
from collision_monitor.narrow_phase.contact_row import BOUND, CONTACT_SIZE, DISTANCE, NORMAL, POINT_A, POINT_B
from collision_monitor.query.batch_result import BatchResult, Pairs
from collision_monitor.query.contact.contact import Contact, contact
from collision_monitor.query.contact.contact_kernel import MEMORY, contacts_of_chains
from collision_monitor.query.library import LIBRARY
from collision_monitor.query.pair_arrays import (
    Progress,
    Shapes,
    batch_shapes,
    pair_count,
    pair_ranges,
    part,
    pose_of,
    pose_rows,
)

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Contacts(BatchResult[Contact]):
    """Contacts of N pairs in the world frame, with the meaning of the fields of `Contact`; lengths in m.

    `contacts[k]` is the Contact of pair k; a slice, a mask or numbers select several pairs.

    >>> import collision_monitor as cm
    >>> found = cm.contacts(cm.Sphere(1), cm.Pose(), cm.Sphere(1), [(0, 0, z, 0, 0, 0, 1) for z in (1, 3)])
    >>> found.overlaps
    array([ True, False])
    >>> found[-1]
    Contact(1 m ± ..., sphere surface – sphere surface)
    >>> found[found.overlaps]
    Contacts(1 pairs, 1 overlap, nearest: pair 0, -1 m)
    """

    signed_distance: Array  # (N,)
    error_bound: Array  # (N,)
    normal: Array  # (N, 3), from A to B
    point_a: Array  # (N, 3)
    point_b: Array  # (N, 3)
    _pairs: Pairs
    _number: NDArray[np.intp]  # (N,), in _pairs
    _is_single: NDArray[np.bool_]  # (N,): made by `contact`

    @property
    def overlaps(self) -> NDArray[np.bool_]:
        """Whether each pair (N,) overlaps or touches; uncertain if |signed_distance| <= error_bound."""
        return self.signed_distance <= 0.0

    def __len__(self) -> int:
        """Number of pairs."""
        return len(self.signed_distance)

    def __repr__(self) -> str:
        """Return a line for a person."""
        if not len(self):
            return "Contacts(0 pairs)"
        k = int(self.signed_distance.argmin())
        return (
            f"Contacts({len(self)} pairs, {np.count_nonzero(self.overlaps)} overlap, "
            f"nearest: pair {k}, {self.signed_distance[k]:.4g} m)"
        )

    def _one(self, k: int) -> Contact:
        shape_a, x_a, shape_b, x_b = self._pairs.of(self._number[k])
        if self._is_single[k]:
            return contact(shape_a, pose_of(x_a), shape_b, pose_of(x_b))
        row = np.zeros(CONTACT_SIZE)
        row[DISTANCE], row[BOUND] = self.signed_distance[k], self.error_bound[k]
        for column, values in ((NORMAL, self.normal), (POINT_A, self.point_a), (POINT_B, self.point_b)):
            row[column : column + 3] = values[k]
        arguments = shape_a, pose_of(x_a), shape_b, pose_of(x_b)
        return Contact(float(row[DISTANCE]), float(row[BOUND]), row, arguments)


def contacts(
    shapes_a: Shapes, poses_a: Any, shapes_b: Shapes, poses_b: Any, progress: Progress | None = None
) -> Contacts:
    """`contact` for N pairs: of the shapes A at the poses A with the shapes B at the poses B.

    shapes: one for all pairs, or a list of N; poses: (N, 7) x y z qx qy qz qw (m), a list of N, or one for all.
    progress: called with the number of pairs that are done. Convex solids take 0.1 to 1 µs a pair; compounds, open
    meshes and meshes that overlap take as long as `contact`. Raises as `contact` does; InputError if lengths differ.

    >>> import collision_monitor as cm
    >>> poses = [(x, 0, 0, 0, 0, 0, 1) for x in (0.5, 1.5, 2.5)]
    >>> found = cm.contacts(cm.Box((1, 1, 1)), cm.Pose(), cm.Sphere(0.5), poses)
    >>> found.signed_distance
    array([-0.5,  0.5,  1.5])
    >>> found
    Contacts(3 pairs, 1 overlap, nearest: pair 0, -0.5 m)
    """
    a, b = batch_shapes(shapes_a, "shapes A"), batch_shapes(shapes_b, "shapes B")
    x_a, x_b = pose_rows(poses_a, "poses A"), pose_rows(poses_b, "poses B")
    count = pair_count(shapes_a=len(a), poses_a=len(x_a), shapes_b=len(b), poses_b=len(x_b))
    if a.has_mesh or b.has_mesh:
        a.plant()
        b.plant()
    are_convex = np.broadcast_to(a.is_convex & b.is_convex, (count,))
    is_single = np.broadcast_to((a.first < 0) | (b.first < 0), (count,)).copy()
    rows = np.zeros((count, RESULT))
    for which in pair_ranges(count, progress):
        contacts_of_chains(
            *LIBRARY.tuples, MEMORY.scratch, part(a.first, which), part(x_a, which), part(b.first, which),
            part(x_b, which), SOLIDS, rows[which],
        )  # fmt: skip
        is_single[which] |= ~are_convex[which] & (rows[which, DISTANCE] <= 0.0)
        for k in (which.start + np.flatnonzero(is_single[which])).tolist():
            poses = (pose_of(x[k if len(x) > 1 else 0]) for x in (x_a, x_b))
            one = contact(a.of(k), next(poses), b.of(k), next(poses))
            rows[k, DISTANCE], rows[k, BOUND] = one.signed_distance, one.error_bound
            for column, value in ((NORMAL, one.normal), (POINT_A, one.point_a), (POINT_B, one.point_b)):
                rows[k, column : column + 3] = value
    normal, point_a, point_b = (rows[:, column : column + 3] for column in (NORMAL, POINT_A, POINT_B))
    pairs = Pairs(a, x_a, b, x_b)
    return Contacts(rows[:, DISTANCE], rows[:, BOUND], normal, point_a, point_b, pairs, np.arange(count), is_single)
