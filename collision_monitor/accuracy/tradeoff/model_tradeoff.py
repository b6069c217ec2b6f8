"""Time and errors of models of the shapes, against the distances of the exact shapes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.accuracy.playback import Played, Step, contacts_by_pair, play_steps
from collision_monitor.accuracy.tradeoff.measurement import Errors, Measurement
from collision_monitor.errors import InputError
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.objects.models import containing_model, parse_model
from collision_monitor.query.contact.contact import contact
from collision_monitor.records import Model
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box

NEAR: Final = 0.3
"""Largest distance of the pairs that are compared (m)."""

COMPARED_STEPS: Final = 12
"""Number of steps, evenly spread, that are compared. A pair of triangle meshes takes most of a second."""

MODELS: Final = (Model.SPHERE, Model.OBB, Model.KDOP26, Model.CONVEX_HULL, Model.AUTO)

Pair = tuple[int, int]


def model_tradeoff(
    scene: str,
    descriptions: Iterable[ObjectDescription],
    steps: Sequence[Step],
    models: Sequence[Model | str] = MODELS,
    progress: Callable[[int], None] = lambda done: None,
) -> list[Measurement]:
    """Return a row for `exact`, which is `contact` of the exact shapes, then a row for each model in the monitor.

    Raises InputError. Pairs up to NEAR apart are compared. An alarm is a pair that is reported to touch. A miss is a
    pair that touches and is not reported. progress: called with the number of steps just done; the total is
    len(steps) * len(models) + min(COMPARED_STEPS, len(steps)).
    """
    if not steps:
        raise InputError(f"scene {scene}: expected at least one step, there is none")
    described = list(descriptions)
    sampled = np.unique(np.linspace(0, len(steps) - 1, COMPARED_STEPS).astype(int)).tolist()
    profile = Profile(contact_margin=NEAR)
    played = {
        model: play_steps(Monitor(profile), [replace(each, model=model) for each in described], steps, progress)
        for model in map(parse_model, models)
    }
    pairs = [set[Pair]().union(*(contacts_by_pair(each.answers[k]) for each in played.values())) for k in sampled]
    truths, seconds = [], []
    for k, wanted in zip(sampled, pairs, strict=True):
        began = time.perf_counter()
        truths.append(_exact(described, steps[k][1], wanted))
        seconds.append(time.perf_counter() - began)
        progress(1)
    base: dict[str, Any] = {"scene": scene, "profile": profile.name, "objects": len(described)}
    base["ttc_error_s"] = Errors.of([])
    exact = Measurement(
        **base, model="exact", steps=len(sampled), step_ms=float(np.median(seconds)) * 1e3,
        step_ms_p99=float(np.percentile(seconds, 99)) * 1e3, pair_us=1e6 * sum(seconds) / max(sum(map(len, pairs)), 1),
        alarms=sum(int(d <= 0.0) for truth in truths for d in truth.values()), false_alarms=0, misses=0,
        distance_error_m=0.0, compared=sum(map(len, pairs)), outside_bound=0, distance_error_part=0.0,
    )  # fmt: skip
    sizes = {each.object_id: _size(each) for each in described}
    return [exact, *(_measurement(base, model, found, sampled, truths, sizes) for model, found in played.items())]


def _exact(described: list[ObjectDescription], states: NDArray[np.void], pairs: set[Pair]) -> dict[Pair, float]:
    """Signed distances (m) of the exact shapes."""
    shapes = {each.object_id: each.shapes for each in described}
    poses = {each.object_id: each.pose for each in described if each.pose is not None}
    poses |= {int(row["id"]): Pose(row["position"], row["quaternion"]) for row in states}
    return {(a, b): contact(shapes[a], poses[a], shapes[b], poses[b]).signed_distance for a, b in sorted(pairs)}


def _size(description: ObjectDescription) -> float:
    """Diagonal (m) of the AABB of an object."""
    piece, _ = containing_model(description.shapes, Model.AABB).pieces[0]
    assert isinstance(piece, Box)
    return float(np.linalg.norm(piece.size))


def _measurement(
    base: dict[str, Any],
    model: Model,
    played: Played,
    sampled: list[int],
    truths: list[dict[Pair, float]],
    sizes: dict[int, float],
) -> Measurement:
    alarms = false_alarms = misses = compared = outside = 0
    errors, parts = [0.0], [0.0]
    for k, truth in zip(sampled, truths, strict=True):
        reported = contacts_by_pair(played.answers[k])
        touching = {pair for pair, row in reported.items() if row["signed_distance"] <= 0.0}
        actual = {pair for pair, distance in truth.items() if distance <= 0.0}
        alarms, false_alarms = alarms + len(touching), false_alarms + len(touching - actual)
        misses += len(actual - touching)
        # overlapping pairs are excluded, because the depths of a mesh and of its model are not comparable
        for pair in reported.keys() - actual:
            off = abs(float(reported[pair]["signed_distance"]) - truth[pair])
            compared += 1
            outside += bool(off > reported[pair]["error_bound"] + 1e-9)
            errors.append(off)
            parts.append(off / min(sizes[each] for each in pair))
    return Measurement(
        **base, model=model.name.lower(), steps=len(played.answers), **played.cost(), alarms=alarms,
        false_alarms=false_alarms, misses=misses, distance_error_m=max(errors), compared=compared,
        outside_bound=outside, distance_error_part=max(parts),
    )  # fmt: skip
