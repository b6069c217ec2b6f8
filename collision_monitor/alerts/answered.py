"""The measures that contacts and predictions hold: time to collision and probability."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from collision_monitor.alerts.measures import Measures
from collision_monitor.alerts.monitored_bodies import MonitoredBodies
from collision_monitor.impact.impact_record import pair_keys
from collision_monitor.monitor.result import StepResult
from collision_monitor.records import ContactStatus, PredictionStatus


def answered(scene: MonitoredBodies, result: StepResult) -> Measures:
    """Return the measures of all pairs in the answers of a step.

    A contact has the time 0 and the probability 1. A pair that passes as stated (POSSIBLE) has an infinite time. The
    probability is 1 as well if no uncertainty is declared, or if the pair is UNRESOLVED.
    """
    contacts = result.contacts.compress(result.contacts["point_index"] == 0)
    predictions = result.predictions
    keys = np.concatenate([pair_keys(rows["id_a"], rows["id_b"]) for rows in (contacts, predictions)])
    keys, first = np.unique(keys, return_index=True)  # a contact comes before a prediction of the same pair
    touching = first < len(contacts)
    c, p = contacts[first[touching]], predictions[first[~touching] - len(contacts)]
    slots = (scene.roster.find_slots((keys >> np.uint64(shift)).astype(np.uint32)) for shift in (32, 0))
    found = Measures(keys, *slots)

    unresolved = p["status"] == PredictionStatus.UNRESOLVED
    stated = p["status"] != PredictionStatus.POSSIBLE
    found["time_to_collision"][touching] = 0.0
    found["time_to_collision"][~touching] = np.where(stated, p["lower"], np.inf)
    is_certain = c["status"] == ContactStatus.TOUCHING
    found["time_to_collision_upper"][touching] = np.where(is_certain, 0.0, np.inf)
    found["time_to_collision_upper"][~touching] = np.where(stated, p["upper"], np.inf)
    found["probability"][touching] = 1.0
    found["probability"][~touching] = np.where(unresolved | np.isnan(p["probability"]), 1.0, p["probability"])
    found["distance"][touching] = c["signed_distance"] - c["error_bound"]
    found["distance_error"][touching] = 2.0 * c["error_bound"]
    found["closing_speed"][touching], found["impact_speed"][~touching] = c["closing_speed"], p["closing_speed"]
    found.points[touching] = np.stack([c["point_a"], c["point_b"]], axis=1)
    found.points[~touching] = p["point"][:, None]
    found.uncertain[touching], found.uncertain[~touching] = ~is_certain, unresolved
    found.is_certain_hit[~touching] = p["status"] == PredictionStatus.HIT
    return found


def is_touching(measures: Measures) -> NDArray[np.bool_]:
    """Return which pairs touch, or cannot be told apart from touching (n,)."""
    return np.asarray(measures["time_to_collision"] == 0.0)
