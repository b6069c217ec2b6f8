"""The measures that a rule may limit, and the thresholds of its levels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.alerts.measures import Measures
from collision_monitor.settings.yaml_entry import YamlEntry

LEVELS: Final = ("caution", "warning", "critical")
"""Names of the levels from 1 on, as in CollisionAlert.msg."""


class Limit(NamedTuple):
    """How a measure is limited. above: values above the threshold are bad, else those below."""

    unit: str
    above: bool
    most: float
    text: str


LIMITS: Final[Mapping[str, Limit]] = {
    "time_to_collision": Limit("s", False, 1000.0, "time to collision"),
    "probability": Limit("", True, 1.0, "probability of contact"),
    "distance": Limit("m", False, 1e6, "distance"),
    "distance_at_closest_approach": Limit("m", False, 1e6, "distance at the closest approach"),
    "time_to_closest_approach": Limit("s", False, 1000.0, "time to the closest approach"),
    "required_deceleration": Limit("m/s²", True, 1e6, "required deceleration"),
    "time_headway": Limit("s", False, 1000.0, "time headway"),
    "post_encroachment_time": Limit("s", False, 1000.0, "post-encroachment time"),
    "separation_margin": Limit("m", False, 1e6, "margin to the protective separation distance"),
}

FROM_ANSWERS: Final = ("time_to_collision", "probability")
"""The measures that come from contacts and predictions; all others come from the states of the selected pairs."""

APPROACH: Final = ("distance_at_closest_approach", "time_to_closest_approach")
"""If a level has both, they are one condition: both have to hold."""


@dataclass(frozen=True)
class Thresholds:
    """The thresholds of one level, by measure."""

    level: int
    values: Mapping[str, float]

    def met(self, measures: Measures) -> NDArray[np.bool_]:
        """Return for each pair (n,) whether any threshold is passed that does not leave it out.

        A measure that is NaN passes none.
        """
        result = np.zeros(len(measures), np.bool_)
        for name, value in self.values.items():
            if name == "time_to_closest_approach":
                continue
            passed = self._passed(name, value, measures)
            if name == APPROACH[0] and APPROACH[1] in self.values:
                passed &= self._passed(APPROACH[1], self.values[APPROACH[1]], measures)
            result |= passed
        return result

    def reasons(self, measures: Measures, k: int) -> str:
        """Return the passed thresholds of pair k in words."""
        one = measures.take(np.array([k]))
        found = []
        for name, value in self.values.items():
            if self._passed(name, value, one)[0]:
                limit = LIMITS[name]
                unit = f" {limit.unit}" if limit.unit else ""
                side = "above" if limit.above else "below"
                found.append(f"{limit.text} {one[name][0]:.3g}{unit} ({side} {value:g}{unit})")
        return ", ".join(found)

    @staticmethod
    def _passed(name: str, value: float, measures: Measures) -> NDArray[np.bool_]:
        column = measures[name]
        passed = column >= value if LIMITS[name].above else column <= value
        return np.asarray(passed & ~measures.quiet[name] if name in measures.quiet else passed)


def read_levels(entry: YamlEntry, content: Mapping[str, YamlEntry]) -> tuple[Thresholds, ...]:
    """Read the thresholds of the levels that a rule has. Raises InputError, also if they contradict each other."""
    found: list[Thresholds] = []
    for level, name in enumerate(LEVELS, 1):
        if name not in content:
            continue
        table = content[name].table(LIMITS)
        if not table:
            raise content[name].error(f"a threshold of at least one of {', '.join(LIMITS)}", "none")
        if APPROACH[1] in table and APPROACH[0] not in table:
            raise table[APPROACH[1]].error(
                f"{APPROACH[0]} beside it, because each approaching pair has such a time", "none"
            )
        values = {}
        for measure, each in table.items():
            limit = LIMITS[measure]
            least = -limit.most if measure in ("distance", "separation_margin") else 0.0
            values[measure] = each.number(limit.unit or "probability", least, limit.most)
        for lower in found:
            _check_order(table, values, lower)
        found.append(Thresholds(level, values))
    if not found:
        raise entry.error(f"at least one of {', '.join(LEVELS)} with its thresholds", "none")
    return tuple(found)


def _check_order(table: Mapping[str, YamlEntry], values: Mapping[str, float], lower: Thresholds) -> None:
    """Refuse a threshold that a lower level passes later. Raises InputError."""
    for measure in values.keys() & lower.values.keys():
        mine, theirs = values[measure], lower.values[measure]
        if mine < theirs if LIMITS[measure].above else mine > theirs:
            order = "at least" if LIMITS[measure].above else "at most"
            raise table[measure].error(
                f"{order} {theirs:g}, the threshold of the lower level {LEVELS[lower.level - 1]}"
            )
