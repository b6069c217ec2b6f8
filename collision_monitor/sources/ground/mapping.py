"""The sources file: which topics hold which objects. `collision-monitor run --sources` and `import --map` read it.

frame: map                               # frame of the monitor; tf transforms poses from other frames
stamps: header                           # or `received`: the time at which the message arrived
rate: 20                                 # Hz of the steps; or `step: /cart/odom`: a step at each of its messages;
                                         # neither: a step at each message
max_age: 1.0                             # s up to which transforms, and states at a step, may be old
objects:
  cart:     {topic: /cart/odom, shape: {box: [1.2, 0.8, 0.5], at: [0, 0, 0.25]}}
  person_1: {topic: /tf, frame: person_1, shape: {capsule: [0.3, 1.1]}}
  traffic:  {topic: /tracked_objects, forget_after: 1.0}           # every track, with the shape in the message
  crate:    {topic: /markers, marker: {ns: crates, id: 7}}         # the marker's own shape
  walls:    {topic: /markers, marker: {ns: walls}, static: true}   # all markers of the namespace: walls_0, walls_1 …
  floor:    {static: true, shape: {half_space: [0, 0, 1, 0]}}
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from collision_monitor.errors import CollisionMonitorError, InputError
from collision_monitor.settings.yaml_file import key_lines, read_yaml
from collision_monitor.sources.ground.object_entry import ObjectEntry, read_entries
from collision_monitor.sources.ground.yaml_table import number, table, text

HEADER, RECEIVED = "header", "received"

SECTIONS: Final[tuple[str, ...]] = ("robots", "plans")
"""Sections with sources of their own; `kinds.beside_topics` reads them."""

_TOP: Final = ("frame", "stamps", "rate", "step", "max_age", "objects", *SECTIONS)


@dataclass(frozen=True)
class Mapping:
    """The content of a sources file.

    stamps: HEADER or RECEIVED. rate: Hz of the steps, 0: not at a rate. step_topic: the topic whose messages make the
    steps, or empty. max_age: s. sections: the content of each further section, unread. lines: the line of each key, by
    the text with which errors begin, such as `cart, shape`. path: of the file, or empty.
    """

    frame: str
    sources: tuple[ObjectEntry, ...] = ()
    stamps: str = HEADER
    rate: float = 0.0
    step_topic: str = ""
    max_age: float = 1.0
    sections: dict[str, Any] = field(default_factory=dict)
    lines: dict[str, int] = field(default_factory=dict)
    path: str = ""

    @property
    def robots(self) -> list[str]:
        """The names of the robots."""
        section = self.sections.get("robots", {})
        return list(section) if isinstance(section, dict) else []

    @property
    def topics(self) -> dict[str, list[ObjectEntry]]:
        """The entries of each topic."""
        found: dict[str, list[ObjectEntry]] = {}
        for source in self.sources:
            if source.topic:
                found.setdefault(source.topic, []).append(source)
        return found

    def located(self, message: str) -> str:
        """Return an error text with the file and the line of the key with which it begins."""
        return located(message, self.path, self.lines)


def load_mapping(path: Path) -> Mapping:
    """Read a sources file. Raises InputError, with the line, the object and the key, if it cannot be used."""
    content = read_yaml(path)
    lines = key_lines(path)
    try:
        return make_mapping(content, str(path), lines)
    except CollisionMonitorError as error:
        raise InputError(located(str(error), str(path), lines)) from None


def make_mapping(content: Any, path: str = "", lines: dict[str, int] | None = None) -> Mapping:
    """Return the mapping of a file's content. Raises InputError."""
    top = table(content, "the file", _TOP)
    frame = top.get("frame")
    if not isinstance(frame, str) or not frame:
        raise InputError(f"frame: expected the name of the frame of the session, such as map, got {frame!r}")
    stamps = top.get("stamps", HEADER)
    if stamps not in (HEADER, RECEIVED):
        raise InputError(f"stamps: expected {HEADER} or {RECEIVED}, got {stamps!r}")
    sections = {name: top[name] for name in SECTIONS if name in top}
    objects = top.get("objects", {} if sections else None)
    if not isinstance(objects, dict):
        raise InputError(f"objects: expected a table of names, got {objects!r}")
    if not (objects or sections):
        raise InputError("objects: expected at least one, as `cart: {topic: /cart/odom, ...}`, got an empty table")
    if "rate" in top and "step" in top:
        raise InputError("rate: expected `rate` or `step`, got both")
    return Mapping(
        frame=frame.removeprefix("/"),
        sources=read_entries(objects),
        stamps=stamps,
        rate=number(top["rate"], "rate", "Hz", least=0.01, most=10_000.0) if "rate" in top else 0.0,
        step_topic=text(top.get("step", ""), "step"),
        max_age=number(top.get("max_age", 1.0), "max_age", "s", least=0.001),
        sections=sections,
        lines=lines or {},
        path=path,
    )


def located(message: str, path: str, lines: dict[str, int]) -> str:
    """Return an error text with the file and the line of the key with which it begins."""
    begins = [key for key in lines if message.startswith((f"{key}:", f"{key},"))]
    where = f"{path}, line {lines[max(begins, key=len)]}" if begins else path
    return f"{where}: {message}" if where else message
