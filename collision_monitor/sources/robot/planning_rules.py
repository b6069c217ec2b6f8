"""Padding, scale and allowed pairs that MoveIt's planning scene states about the links of a robot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from collision_monitor.errors import InputError
from collision_monitor.robots.srdf import Pair
from collision_monitor.robots.urdf import LONGEST_LINK_NAME
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.robot.collision_matrix import ALLOWED, DENIED, CollisionMatrix
from collision_monitor.sources.robot.link_rules import LinkRules

MOST_LINKS = 10_000
"""Links with a padding or a scale of their own."""

MOST_ALLOWED = 100_000
"""Pairs of a link or attached object and another object whose contact is expected."""


class PlanningRules:
    """The rules of the last planning scenes. name: of the source, for refusals."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._matrix: CollisionMatrix | None = None
        self._padding: dict[str, float] = {}
        self._scale: dict[str, float] = {}

    def take(self, content: Any, scene: SourceScene) -> bool:
        """Take over what a PlanningScene states. Return whether a rule changed.

        An empty list of a difference states nothing. A scene that is no difference replaces everything, also by empty
        lists. A matrix that cannot be read allows nothing. Source: MoveIt, planning_scene.cpp, setPlanningSceneMsg and
        setPlanningSceneDiffMsg.
        """
        before = self._matrix, dict(self._padding), dict(self._scale)
        if not content.is_diff:
            self._matrix = None
            self._padding.clear()
            self._scale.clear()
        matrix = content.allowed_collision_matrix
        if len(matrix.entry_names) or len(matrix.default_entry_names):
            self._matrix = None
            with scene.guard(self._name):
                self._matrix = CollisionMatrix(matrix)
        for rows, field, known in (
            (content.link_padding, "padding", self._padding),
            (content.link_scale, "scale", self._scale),
        ):
            for row in rows:
                value, link = float(getattr(row, field)), str(row.link_name)[:LONGEST_LINK_NAME]
                if not (0.0 <= value < 1e3 and (value > 0.0 or field == "padding")):
                    scene.refuse(self._name, f"{field} of {link:.80}: expected a positive number, got {value}")
                elif link in known or len(known) < MOST_LINKS:
                    known[link] = value
                else:
                    scene.refuse(self._name, f"{field}: expected at most {MOST_LINKS} links, got more")
        return before != (self._matrix, self._padding, self._scale)

    def forget(self, name: str) -> None:
        """Forget what is said about an object that was removed."""
        if self._matrix is not None:
            self._matrix.forget(name)

    def of(
        self, links: Mapping[str, int], held: Iterable[str], ids: Sequence[tuple[str, int]], disabled: frozenset[Pair]
    ) -> LinkRules:
        """Return the rules for links, by name their ids, and attached objects.

        ids: name and id of all objects of the scene. disabled: the pairs of links that the SRDF disables. Raises
        InputError for more allowed pairs than MOST_ALLOWED.
        """
        padding, scale = dict(self._padding), dict(self._scale)
        if self._matrix is None:
            return LinkRules(padding, scale)
        ours = [*links, *held]
        names = [name for name, _ in ids]
        places = self._matrix.places(names)
        allowed: dict[str, frozenset[int]] = {}
        total = 0
        for name in ours:  # row by row, so that a large scene takes little memory
            row = self._matrix.answers(name, places) == ALLOWED
            others = frozenset(ids[k][1] for k in np.flatnonzero(row).tolist() if names[k] != name)
            total += len(others)
            if total > MOST_ALLOWED:
                raise InputError(f"allowed collision matrix: expected at most {MOST_ALLOWED} allowed pairs, got more")
            if others:
                allowed[name] = others
        checked = set()
        by_first: dict[str, list[str]] = {}
        for a, b in sorted(disabled):
            by_first.setdefault(a, []).append(b)
        for a, others_of in by_first.items():
            row = self._matrix.answers(a, self._matrix.places(others_of)) == DENIED
            checked |= {(a, others_of[k]) for k in np.flatnonzero(row).tolist()}
        return LinkRules(padding, scale, allowed, frozenset(checked))
