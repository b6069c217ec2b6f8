"""Expected contacts of a robot's links and of the bodies they carry, and what a planning scene changes about links."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping as Table
from dataclasses import dataclass, field

from collision_monitor.robots.robot import Robot
from collision_monitor.robots.srdf import Pair
from collision_monitor.sources.robot.carried_bodies import Body


@dataclass(frozen=True)
class LinkRules:
    """What a planning scene changes about links, by their names.

    padding: m, more than the file's. scale: of the shapes. allowed: ids of objects whose contact is expected. checked:
    pairs that are monitored although the SRDF disables them.
    """

    padding: Table[str, float] = field(default_factory=dict)
    scale: Table[str, float] = field(default_factory=dict)
    allowed: Table[str, frozenset[int]] = field(default_factory=dict)
    checked: frozenset[Pair] = frozenset()


def allowed_contacts(
    robot: Robot,
    links: Table[str, Body],
    attached: Table[str, Body],
    by_file: Table[str, Iterable[int]],
    rules: LinkRules,
) -> dict[int, tuple[int, ...]]:
    """Return the ids of the objects that each body may touch, by its id. by_file: ids that the sources file allows."""
    found: dict[int, set[int]] = {body.object_id: set() for body in (*links.values(), *attached.values())}
    for a, b in robot.touching | (robot.disabled - rules.checked):
        found[links[a].object_id].add(links[b].object_id)
        found[links[b].object_id].add(links[a].object_id)
    for link, others in (*by_file.items(), *rules.allowed.items()):
        if link in links:
            found[links[link].object_id] |= set(others)
    for name, body in attached.items():
        touched = {*body.touch, body.link} & links.keys()
        found[body.object_id] |= {links[link].object_id for link in touched}
        found[body.object_id] |= rules.allowed.get(name, frozenset())
        found[body.object_id] |= {other.object_id for other in attached.values() if other.link == body.link}
    return {object_id: tuple(sorted(others - {object_id})) for object_id, others in found.items()}
