"""The list of the soonest pairs: those that touch, then the predicted ones in the order of time."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.settings.names import shortened
from collision_monitor.view.levels import Level, Pair, contact_levels, prediction_levels
from collision_monitor.view.moment import Moment

WIDEST: Final = 44
"""Characters of a row that the panel shows; it cuts off the rest, at the second name."""

SHORTEST_NAME: Final = 8
"""Characters of a name that are left if the time is long."""


class PairRow(NamedTuple):
    """A pair of the list. when: text; place (3,): m, in the world, where they touch or will; None: not known."""

    pair: Pair
    names: tuple[str, str]
    when: str
    level: Level
    place: NDArray[np.float64] | None

    @property
    def text(self) -> str:
        """One line for people."""
        room = max(WIDEST - len(self.when) - len("   – "), 2 * SHORTEST_NAME)
        first, second = sorted(self.names, key=len)
        short = shortened(first, max(room // 2, room - len(second)))
        by_name = {first: short, second: shortened(second, room - len(short))}
        return f"{self.when}  {by_name[self.names[0]]} – {by_name[self.names[1]]}"


def soonest_pairs(moment: Moment, most: int) -> list[PairRow]:
    """Return at most `most` pairs."""
    contacts, rows = moment.contacts, []
    levels = contact_levels(contacts)
    for k in np.flatnonzero((levels != Level.CLEAR) & (contacts["point_index"] == 0))[:most]:
        rows.append(_contact_row(moment, contacts[k], Level(int(levels[k]))))
    predictions = moment.predictions[: most - len(rows)]
    for row, level in zip(predictions, prediction_levels(predictions), strict=True):
        rows.append(_prediction_row(moment, row, Level(int(level))))
    return rows


def _contact_row(moment: Moment, row: np.void, level: Level) -> PairRow:
    deep = -float(row["signed_distance"])
    when = "unresolved now" if level is Level.UNRESOLVED else f"now, {1e3 * deep:.0f} mm deep" if deep > 0.0 else "now"
    return _row(moment, row, when, level, 0.5 * (row["point_a"] + row["point_b"]))


def _prediction_row(moment: Moment, row: np.void, level: Level) -> PairRow:
    lower, probability = float(row["lower"]), float(row["probability"])
    if level is Level.UNRESOLVED:
        when = f"≥ {lower:.2f} s, unresolved"
    elif level is Level.POSSIBLE:
        when = f"≥ {lower:.2f} s, {probability:.0%}" if math.isfinite(probability) else f"≥ {lower:.2f} s, possible"
    else:
        when = f"{lower:.2f} s, {probability:.0%}" if math.isfinite(probability) else f"{lower:.2f} s"
    return _row(moment, row, f"{when}, stale" if row["stale"] else when, level, row["point"])


def _row(moment: Moment, row: np.void, when: str, level: Level, place: NDArray[np.float64]) -> PairRow:
    a, b = int(row["id_a"]), int(row["id_b"])
    if not np.isfinite(place).all():
        at = moment.rows_of(np.array([a, b], np.uint32))
        place = moment.state["position"][at].mean(axis=0) if (at >= 0).all() else np.full(3, np.nan)
    known = np.array(place, np.float64) if np.isfinite(place).all() else None
    return PairRow((a, b), (moment.name_of(a), moment.name_of(b)), when, level, known)
