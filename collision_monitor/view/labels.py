"""The labels in the scene: the soonest pairs and the selected object."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.view.bodies import Floats
from collision_monitor.view.moment import Moment
from collision_monitor.view.pair_list import PairRow

NAMED: Final = 3
"""Soonest pairs with a label. More labels would hide each other."""

SIZE: Final = 0.08
"""Size of a label when the page shows the whole scene, in radii of the scene."""


class Label(NamedTuple):
    """A text in the scene. key: what it is about, the same in each picture; place (3,): m, from the origin."""

    key: str
    text: str
    place: NDArray[np.float32]


def labels(
    moment: Moment, rows: list[PairRow], selected: int | None, origin: Floats, extent: float, unit: float
) -> list[Label]:
    """Return the texts of the soonest pairs, each at its place, and the name of the selected object above it.

    extent, unit: of the `Picture`.
    """
    found = [
        Label("{}_{}".format(*row.pair), row.text, (row.place - origin).astype(np.float32))
        for row in rows[:NAMED]
        if row.place is not None
    ]
    at = moment.rows_of(np.array([] if selected is None else [selected], np.uint32))
    for row in at[at >= 0]:
        up = min(moment.bodies.reach[moment.body[row]], 2.0 * unit)
        place = moment.state["position"][row] - origin + (0.0, 0.0, up)
        found.append(Label("selected", moment.name_of(int(moment.ids[row])), place.astype(np.float32)))
    return _joined(found, SIZE * extent)


def _joined(given: list[Label], distance: float) -> list[Label]:
    """Write labels that would cover each other, at less than this distance (m), one below the other."""
    found: list[Label] = []
    for label in given:
        near = [k for k, each in enumerate(found) if np.linalg.norm(each.place - label.place) < distance]
        if near:
            first = found[near[0]]
            found[near[0]] = first._replace(text=f"{first.text}\n{label.text}")
        else:
            found.append(label)
    return found
