"""How objects are expected to move on from their states, by what they are: `motion` and `acceleration` of an entry.

motion: arc                                  # all objects of the entry
motion: {pedestrian: people, others: stops}  # by the class in the messages
acceleration: damped                         # or measured, off

arc: along the axes of the object, as a wheeled robot or a car in a bend; an acceleration against the velocity ends at
rest. stops: along the axes of the world, likewise. straight: along the axes of the world, with an acceleration that
goes on for ever. people: with constant velocity. free_fall: with the acceleration of gravity along -z.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from math import exp
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.records import StateFlag
from collision_monitor.sources.ground.yaml_table import known

ARC, STRAIGHT, STOPS, PEOPLE, FREE_FALL = MODELS = ("arc", "straight", "stops", "people", "free_fall")
MEASURED, DAMPED, OFF = ACCELERATIONS = ("measured", "damped", "off")

OTHERS: Final = "others"
"""In a table of classes: all classes that it does not name."""

MOST_CLASSES: Final = 100
"""Classes in a table."""

GRAVITY: Final = 9.80665
"""m/s^2: standard gravity (ISO 80000-3)."""

MANOEUVRE: Final = 1.0
"""s: time constant with which a measured acceleration decays if it is damped (Singer, Estimating optimal tracking
filter performance for manned maneuvering targets, 1970; he takes 1 s to 60 s for aircraft). Smaller: it counts less."""

_VALID, _STOPS = np.uint32(StateFlag.ACCELERATION_VALID), np.uint32(StateFlag.STOPS)


class MotionChoice(NamedTuple):
    """What an entry says about motions. by_class: the model of each class, and of OTHERS."""

    by_class: Mapping[str, str] = MappingProxyType({})
    acceleration: str = MEASURED


AS_USUAL: Final = MotionChoice()
"""Of an entry that says nothing."""


class MotionModels:
    """The model of each class of objects of an entry. Raises InputError for a class that there is not.

    name: of the entry. default: the model of objects whose class has none. classes: those that the messages can hold;
    None: any. by_class: defaults of classes.
    """

    def __init__(
        self,
        name: str,
        choice: MotionChoice,
        default: str,
        classes: Collection[str] | None = (),
        by_class: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        if classes is not None:
            for word in choice.by_class:
                known(word, (*classes, OTHERS), f"{name}, motion")
        others = choice.by_class.get(OTHERS)
        self._default = others or default
        self._by_class = {**({} if others else by_class), **choice.by_class}
        self._acceleration = choice.acceleration

    def apply(self, states: Any, classes: Sequence[str], horizon: float) -> NDArray[np.bool_]:
        """Let states (N,) of records.STATE in the monitor's frame move on as the models of their classes (N,) say.

        horizon: s that the monitor looks ahead. Returns which twists turn with their objects (N,), for
        `SourceScene.observe`.
        """
        models = np.array([self._by_class.get(word, self._default) for word in classes])
        falls = models == FREE_FALL
        off = (models == PEOPLE) | (self._acceleration == OFF)
        if self._acceleration == DAMPED:
            states["acceleration"] *= damped_part(horizon)
        states["acceleration"][off] = 0.0
        states["flags"][off] &= ~_VALID
        states["acceleration"][falls] = 0.0, 0.0, -GRAVITY
        states["flags"][falls] |= _VALID
        ends = np.isin(models, (ARC, STOPS)) & ((states["flags"] & _VALID) != 0)
        states["flags"][~ends] &= ~_STOPS
        states["flags"][ends] |= _STOPS
        return np.asarray(models == ARC)


def damped_part(horizon: float) -> float:
    """Part of an acceleration that, kept constant, leads as far within the horizon (s) as the decaying one.

    a exp(-t / T) leads to a T^2 (h / T - 1 + exp(-h / T)) within h, with T = MANOEUVRE.
    """
    h = horizon / MANOEUVRE
    return 1.0 if h < 1e-4 else 2.0 * (h - 1.0 + exp(-h)) / (h * h)


def read_motion(content: Mapping[str, Any], name: str) -> MotionChoice:
    """Return what the keys `motion` and `acceleration` of an entry say. Raises InputError."""
    given = content.get("motion", {})
    models = given if isinstance(given, dict) else {OTHERS: given}
    if len(models) > MOST_CLASSES:
        raise InputError(f"{name}, motion: expected a model, or at most {MOST_CLASSES} classes, got {len(models)}")
    for model in models.values():
        known(str(model), MODELS, f"{name}, motion")
    acceleration = content.get("acceleration", MEASURED)
    if acceleration is False:  # what YAML 1.1 makes of `off`
        acceleration = OFF
    known(str(acceleration), ACCELERATIONS, f"{name}, acceleration")
    return MotionChoice({str(word): str(model) for word, model in models.items()}, str(acceleration))
