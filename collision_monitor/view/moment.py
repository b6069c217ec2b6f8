"""A moment: what the monitor's messages say at one time. Data only."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from collision_monitor import records
from collision_monitor.motion.moved_states import moved_states
from collision_monitor.view.bodies import DescribedBodies, Floats, Indices
from collision_monitor.view.levels import Level, Pair


@dataclass(frozen=True, eq=False)
class Moment:
    """The objects and the answers after one step.

    body (n,): rows of `bodies` with a pose, ascending by id; state (n,): the last one of each, records.STATE (of a
    static one: its pose); age (n,): s from that state to the step. contacts, predictions: of the step, records.CONTACT
    and PREDICTION. names: of the objects that the answers mention. alerts: the raised ones; None without rules.
    is_known: whether there are answers; without them, nothing may be shown as clear.
    """

    bodies: DescribedBodies
    body: Indices
    state: NDArray[np.void]
    age: Floats
    contacts: NDArray[np.void] = field(default_factory=lambda: np.zeros(0, records.CONTACT))
    predictions: NDArray[np.void] = field(default_factory=lambda: np.zeros(0, records.PREDICTION))
    names: Mapping[int, str] = field(default_factory=dict)
    horizon: float = 0.0
    stamp_ns: int = 0
    step: int = 0
    alerts: Mapping[Pair, Level] | None = None
    is_known: bool = True

    @property
    def ids(self) -> NDArray[np.uint32]:
        """Ids (n,) of the objects, ascending."""
        ids: NDArray[np.uint32] = self.bodies.ids[self.body]
        return ids

    @property
    def unseen(self) -> int:
        """Number of described objects whose pose is not known."""
        return len(self.bodies.ids) - len(self.body)

    def rows_of(self, ids: NDArray[np.uint32]) -> Indices:
        """Return the row of each id in `body`, or -1."""
        mine = self.ids
        if not len(mine):
            return np.full(len(ids), -1, np.intp)
        at = np.minimum(np.searchsorted(mine, ids), len(mine) - 1)
        return np.where(mine[at] == ids, at, -1)

    def name_of(self, object_id: int) -> str:
        """Return the name of an object, or a substitute if no message mentions it."""
        if object_id in self.names:
            return self.names[object_id]
        at = int(np.searchsorted(self.bodies.ids, object_id))
        known = at < len(self.bodies.ids) and self.bodies.ids[at] == object_id
        return self.bodies.descriptions[at].name if known else f"object_{object_id}"

    def poses_at(self, rows: Indices, after: Floats) -> tuple[Floats, Floats]:
        """Return positions (k, 3) and quaternions (k, 4) `after` (k,) s from the step, as the last states move."""
        moved = moved_states(self.state[rows], after + self.age[rows])
        return moved["position"], moved["quaternion"]
