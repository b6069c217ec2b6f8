"""Padding, scale and allowed pairs that MoveIt's planning scene states about the links of a robot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from collision_monitor.errors import CollisionMonitorError
from collision_monitor.robots.srdf import ordered
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.robot.collision_matrix import CollisionMatrix
from collision_monitor.sources.robot.link_rules import LinkRules

MOST_LINKS = 10_000
"""Links with a padding or a scale of their own."""


class PlanningRules:
    """The rules of the last planning scenes. name: of the source, for refusals."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._matrix: CollisionMatrix | None = None
        self._padding: dict[str, float] = {}
        self._scale: dict[str, float] = {}

    def take(self, content: Any, scene: SourceScene) -> bool:
        """Take over what a PlanningScene states; an empty list states nothing. Return whether a rule changed."""
        changed = False
        matrix = content.allowed_collision_matrix
        if len(matrix.entry_names) or len(matrix.default_entry_names):
            try:
                self._matrix, changed = CollisionMatrix(matrix), True
            except CollisionMonitorError as error:
                scene.refuse(self._name, str(error))
        for rows, field, known in (
            (content.link_padding, "padding", self._padding),
            (content.link_scale, "scale", self._scale),
        ):
            for row in rows:
                value, link = float(getattr(row, field)), str(row.link_name)
                if not (0.0 <= value < 1e3 and (value > 0.0 or field == "padding")):
                    scene.refuse(self._name, f"{field} of {link:.80}: expected a positive number, got {value}")
                elif known.get(link) != value and len(known) < MOST_LINKS:
                    known[link] = value
                    changed = True
        return changed

    def of(self, links: Mapping[str, int], held: Iterable[str], ids: Mapping[str, int]) -> LinkRules:
        """Return the rules for links, by name their ids, and attached objects. ids: of all objects of the scene."""
        padding, scale = dict(self._padding), dict(self._scale)
        if self._matrix is None:
            return LinkRules(padding, scale)
        allowed: dict[str, set[int]] = {}
        checked = set()
        for a in (*links, *held):
            for b, object_id in ids.items():
                answer = self._matrix.allows(a, b) if a != b else None
                if answer:
                    allowed.setdefault(a, set()).add(object_id)
                elif answer is False and a in links and b in links:
                    checked.add(ordered(a, b))
        expected = {name: frozenset(found) for name, found in allowed.items()}
        return LinkRules(padding, scale, expected, frozenset(checked))
