"""Calibration: by class of objects, which motion model predicts a recording best, and how its errors grow.

Models and standard deviations are fitted to the first half of the recording and judged on the second half.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.accuracy.calibration.error_growth import ErrorGrowth, fitted_growth
from collision_monitor.accuracy.calibration.motion_errors import CANDIDATES, MotionCandidate, errors_of
from collision_monitor.errors import InputError
from collision_monitor.records import StateFlag
from collision_monitor.session.history.history import History
from collision_monitor.session.history.object_tracks import ObjectTrack, Tracks

Floats = NDArray[np.float64]

LEADS: Final = (0.5, 1.0, 2.0)
"""s ahead at which the models are compared."""

GROWTH: Final = (0.1, 0.25, *LEADS)
"""s ahead of which the growth of the errors is fitted."""

AS_GOOD: Final = 1.02
"""The simplest model whose mean error is within this factor of the least one is chosen."""

FEWEST: Final = 20
"""Errors in each half at the longest lead, below which a class is left out."""

FLAT: Final = 1e-3
"""m: a class whose objects rise and fall by less moves in the plane."""

RADII: Final = {2: 2.4477, 3: 2.7955}
"""Radius that holds 95 % of a normal distribution in the plane and in space, in standard deviations of one axis."""

_NUMBER: Final = re.compile(r"[_ ]?\d+$")


@dataclass(frozen=True)
class ModelErrors:
    """Root mean squares of the errors (m) at LEADS, in the first and in the second half."""

    candidate: MotionCandidate
    fitted: tuple[float, ...]
    held_out: tuple[float, ...]


@dataclass(frozen=True)
class ClassCalibration:
    """One class. objects, states: counts. axes: 2 or 3. models: all that were compared. chosen: one of them.

    growth: of the chosen one, from the first half. within: the part of the errors of the second half at each of LEADS
    that lies within the radius of 95 %.
    """

    name: str
    objects: int
    states: int
    axes: int
    models: tuple[ModelErrors, ...]
    chosen: ModelErrors
    growth: ErrorGrowth
    within: tuple[float, ...]


def class_of(name: str) -> str:
    """The class of an object by its name: without the number at its end.

    >>> class_of("traffic_car_12")
    'traffic_car'
    """
    return _NUMBER.sub("", name) or name


def calibrate(history: History, progress: Callable[[], None] = lambda: None) -> list[ClassCalibration]:
    """Calibrate the classes of the moving objects of a session, by name. progress: called after each model.

    Raises InputError if no class has enough states.
    """
    tracks, classes = Tracks(history), dict[str, list[ObjectTrack]]()
    for object_id, it in sorted(history.objects.items()):
        track = None if it.static else tracks[object_id]
        if track is not None and len(track.time) > 1:
            classes.setdefault(class_of(it.name), []).append(track)
    ends = [time for group in classes.values() for track in group for time in (track.time[0], track.time[-1])]
    middle, horizon = 0.5 * (min(ends, default=0.0) + max(ends, default=0.0)), history.profile.horizon
    found = [_class(name, group, middle, horizon, progress) for name, group in sorted(classes.items())]
    kept = [each for each in found if each is not None]
    if not kept:
        raise InputError(
            f"{history.name}: expected a class of moving objects with {FEWEST} predictions over {LEADS[-1]:g} s, with "
            f"known twists, in each half; got none among {', '.join(sorted(classes)) or 'no objects'}"
        )
    return kept


def _class(
    name: str, tracks: list[ObjectTrack], middle: float, horizon: float, progress: Callable[[], None]
) -> ClassCalibration | None:
    accelerates = any(((it.states["flags"] & np.uint32(StateFlag.ACCELERATION_VALID)) != 0).any() for it in tracks)
    rises = any(np.ptp(track.states["position"][:, 2]) > FLAT for track in tracks)
    models, halves = [], {}
    for candidate in CANDIDATES:
        if candidate.motion == "free_fall" and not rises:
            continue
        if not accelerates and candidate.acceleration != "off" and candidate.motion not in ("people", "free_fall"):
            continue  # it is the same as a simpler one
        errors = {lead: _halves(tracks, candidate, lead, middle, horizon) for lead in GROWTH}
        if min(len(half) for half in errors[LEADS[-1]]) < FEWEST:
            return None
        rms = [tuple(_rms(errors[lead][half]) for lead in LEADS) for half in (0, 1)]
        models.append(ModelErrors(candidate, *rms))
        halves[candidate] = errors
        progress()
    best = min(np.mean(each.fitted) for each in models)
    chosen = next(each for each in models if np.mean(each.fitted) <= AS_GOOD * best)
    errors = halves[chosen.candidate]
    axes = 3 if rises else 2
    growth = fitted_growth(GROWTH, [float((errors[lead][0] ** 2).sum(axis=1).mean()) / axes for lead in GROWTH])
    within = tuple(
        float((np.linalg.norm(errors[lead][1], axis=1) <= RADII[axes] * growth.after(lead)).mean()) for lead in LEADS
    )
    states = sum(len(track.time) for track in tracks)
    return ClassCalibration(name, len(tracks), states, axes, tuple(models), chosen, growth, within)


def _halves(
    tracks: list[ObjectTrack], candidate: MotionCandidate, lead: float, middle: float, horizon: float
) -> tuple[Floats, Floats]:
    """Errors (n, 3) of predictions that end in the first half, and of those that begin in the second one."""
    first, second = [], []
    for track in tracks:
        time, error = errors_of(track, candidate, lead, horizon)
        first.append(error[time + lead <= middle])
        second.append(error[time >= middle])
    return np.concatenate(first), np.concatenate(second)


def _rms(errors: Floats) -> float:
    return float(np.sqrt((errors**2).sum(axis=1).mean())) if len(errors) else float("nan")


def settings_text(found: list[ClassCalibration]) -> str:
    """Return the keys of a sources file for each class, as YAML with comments."""
    lines = ["# for the entries of `objects:` in a sources file"]
    for each in found:
        motion, acceleration = each.chosen.candidate
        measured = MotionCandidate(motion, "measured") in [model.candidate for model in each.models]
        keys = f"motion: {motion}"
        if measured and acceleration != "measured":  # else there are none
            keys += f", acceleration: {acceleration}"
        lines.append(f"{each.name}: {{{keys}, position_stddev: {each.growth.position:.3g}}}")
        lines.append(
            f"# {each.name}: velocity_stddev {each.growth.velocity:.3g} m/s; accelerations that no model knows, one "
            f"standard deviation: {each.growth.acceleration:.3g} m/s^2"
        )
    return "\n".join(lines)
