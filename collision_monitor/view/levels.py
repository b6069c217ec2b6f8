"""The level of an object: how the page colours it."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.records import ContactStatus, Phase, PredictionStatus


class Level(IntEnum):
    """Level of an object or of a pair. Of several pairs of an object, the highest counts."""

    STATIC = 0
    CLEAR = 1
    POSSIBLE = 2
    PREDICTED = 3
    UNRESOLVED = 4
    TOUCHING = 5
    CAUTION = 6
    WARNING = 7
    CRITICAL = 8


COLORS: Final[NDArray[np.uint8]] = np.array(
    [
        (150, 156, 164),
        (84, 140, 205),
        (226, 205, 120),
        (240, 150, 40),
        (176, 96, 214),
        (216, 62, 52),
        (240, 205, 60),
        (240, 135, 35),
        (222, 48, 44),
    ],
    np.uint8,
)
"""Colour (9, 3) of each level, as red, green and blue."""

TEXTS: Final[dict[Level, str]] = {
    Level.STATIC: "does not move",
    Level.CLEAR: "no collision predicted",
    Level.POSSIBLE: "may collide, by its uncertainty",
    Level.PREDICTED: "will collide",
    Level.UNRESOLVED: "not known, or unresolved",
    Level.TOUCHING: "touches",
    Level.CAUTION: "caution",
    Level.WARNING: "warning",
    Level.CRITICAL: "critical",
}
"""The legend."""

ANSWER_LEVELS: Final = (Level.CLEAR, Level.POSSIBLE, Level.PREDICTED, Level.UNRESOLVED, Level.TOUCHING, Level.STATIC)
ALERT_LEVELS: Final = (Level.CLEAR, Level.CAUTION, Level.WARNING, Level.CRITICAL, Level.UNRESOLVED, Level.STATIC)

Pair = tuple[int, int]


def contact_levels(contacts: NDArray[np.void]) -> NDArray[np.uint8]:
    """Return the level of each contact (n,): TOUCHING, UNRESOLVED, or CLEAR if it has ended."""
    unresolved = contacts["status"] == ContactStatus.UNRESOLVED
    level = np.where(unresolved, np.uint8(Level.UNRESOLVED), np.uint8(Level.TOUCHING))
    return np.where(contacts["phase"] == Phase.END, np.uint8(Level.CLEAR), level)


def prediction_levels(predictions: NDArray[np.void]) -> NDArray[np.uint8]:
    """Return the level of each prediction (n,)."""
    status = predictions["status"]
    level = np.full(len(predictions), Level.PREDICTED, np.uint8)
    level[status == PredictionStatus.UNRESOLVED] = Level.UNRESOLVED
    level[status == PredictionStatus.POSSIBLE] = Level.POSSIBLE
    return level


def object_levels(
    ids: NDArray[np.uint32],
    static: NDArray[np.bool_],
    is_known: bool,
    contacts: NDArray[np.void],
    predictions: NDArray[np.void],
    alerts: Mapping[Pair, Level] | None = None,
) -> NDArray[np.uint8]:
    """Return the level of each object (n,). This is the one place that decides it.

    ids (n,), ascending; static (n,). is_known: whether there are answers. contacts, predictions: of one step.
    alerts: the raised ones; None: colour by the answers.
    """
    level = np.where(static, np.uint8(Level.STATIC), np.uint8(Level.CLEAR if is_known else Level.UNRESOLVED))
    if not is_known:
        return level
    if alerts is None:
        for rows, of_pair in ((predictions, prediction_levels(predictions)), (contacts, contact_levels(contacts))):
            raised = of_pair > Level.CLEAR
            _raise(level, ids, rows["id_a"][raised], of_pair[raised])
            _raise(level, ids, rows["id_b"][raised], of_pair[raised])
    elif alerts:
        pairs, of_alert = np.array(list(alerts), np.uint32), np.array(list(alerts.values()), np.uint8)
        _raise(level, ids, pairs[:, 0], of_alert)
        _raise(level, ids, pairs[:, 1], of_alert)
    return level


def _raise(level: NDArray[np.uint8], ids: NDArray[np.uint32], of: NDArray[np.uint32], by: NDArray[np.uint8]) -> None:
    """Raise the levels of the objects `of` to at least `by`. Ids that are not among `ids` change nothing."""
    if not len(ids):
        return
    at = np.minimum(np.searchsorted(ids, of), len(ids) - 1)
    known = ids[at] == of
    np.maximum.at(level, at[known], by[known])
