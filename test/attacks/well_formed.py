"""What every answer has to be, whatever the input was: complete messages with numbers that mean something."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec import ContactArray, PredictedCollisionArray
from collision_monitor.records import ContactStatus, Phase, PredictionStatus

PHASES: Final = len(Phase)
STATUSES: Final = len(ContactStatus)
PREDICTION_STATUSES: Final = len(PredictionStatus)
END: Final = int(Phase.END)


def faults_of_contacts(message: ContactArray) -> list[str]:
    """Return what is wrong with a ContactArray, one sentence each."""
    rows = message.contacts
    found = _faults_of_names(rows, message.ids, message.names)
    if not len(rows):
        return found
    keys = rows[["id_a", "id_b", "phase", "point_index"]].tolist()
    if sorted(keys, key=_end_first) != keys:
        found.append("contacts are not sorted")
    now = rows[rows["phase"] != END]
    if rows["phase"].max() >= PHASES or rows["status"].max() >= STATUSES:
        found.append("a contact has an unknown phase or status")
    if np.isnan(now["signed_distance"]).any() or not (now["error_bound"] >= 0.0).all():
        columns = ["id_a", "id_b", "signed_distance", "error_bound"]
        found.append(f"a contact has no distance or bound: {now[columns][:4]}")
    if not (now["duration"] >= 0.0).all():  # NaN where a contact ended because the clock began anew
        found.append(f"a contact has no duration: {rows['duration'].tolist()[:4]}")
    length = np.einsum("ij,ij->i", now["normal"], now["normal"])
    if (abs(length - 1.0) > 1e-6).any():  # a normal that is not known is NaN
        found.append(f"a normal is not of unit length: {length.tolist()[:4]}")
    return found


def _end_first(key: tuple[int, int, int, int]) -> tuple[int, int, bool, int]:
    id_a, id_b, phase, point = key
    return id_a, id_b, phase != END, point


def faults_of_predictions(message: PredictedCollisionArray) -> list[str]:
    """Return what is wrong with a PredictedCollisionArray, one sentence each."""
    rows = message.predictions
    found = _faults_of_names(rows, message.ids, message.names)
    if not len(rows):
        return found
    keys = rows[["lower", "id_a", "id_b"]].tolist()
    if sorted(keys) != keys:
        found.append("predictions are not sorted")
    if rows["status"].max() >= PREDICTION_STATUSES:
        found.append("a prediction has an unknown status")
    if not ((rows["lower"] >= 0.0) & (rows["upper"] >= rows["lower"])).all():
        found.append(f"a time of impact is no interval: {rows[['id_a', 'id_b', 'lower', 'upper']][:4]}")
    if ((rows["probability"] < 0.0) | (rows["probability"] > 1.0)).any():  # NaN: nothing is uncertain
        found.append(f"a probability is none: {rows['probability'].tolist()[:4]}")
    return found


def _faults_of_names(rows: NDArray[np.void], ids: NDArray[np.uint32], names: list[str]) -> list[str]:
    mentioned = sorted({*rows["id_a"].tolist(), *rows["id_b"].tolist()})
    found = []
    if mentioned != ids.tolist() or len(names) != len(ids):
        found.append(f"ids and names: expected those of {mentioned}, got {ids.tolist()} and {len(names)} names")
    if not (rows["id_a"] < rows["id_b"]).all():
        found.append("a pair is not ordered by id")
    return found
