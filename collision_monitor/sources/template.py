"""A sources file to start from, made of the topics that are there."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, NamedTuple

from collision_monitor.sources.messages.autoware import PREDICTED, TRACKED
from collision_monitor.sources.messages.clouds import CLOUD, SCAN
from collision_monitor.sources.messages.detections import DETECTIONS
from collision_monitor.sources.messages.footprints import FOOTPRINT
from collision_monitor.sources.messages.grid_maps import GRID_MAP
from collision_monitor.sources.messages.grids import COSTMAP, GRID
from collision_monitor.sources.messages.markers import MARKER, MARKERS
from collision_monitor.sources.messages.octomaps import OCTOMAP
from collision_monitor.sources.messages.poses import ODOMETRY, POSE, POSE_WITH_COVARIANCE
from collision_monitor.sources.robot.planning_scene import COLLISION_OBJECT, PLANNING_SCENE
from collision_monitor.sources.robot.robot_template import robot_lines

_ENTRIES: Final = {
    ODOMETRY: "shape: {box: [1.0, 0.7, 0.5]}",
    POSE: "shape: {box: [1.0, 0.7, 0.5]}",
    POSE_WITH_COVARIANCE: "shape: {box: [1.0, 0.7, 0.5]}",
    TRACKED: "forget_after: 1.0",
    PREDICTED: "forget_after: 1.0",
    DETECTIONS: "forget_after: 1.0, position_stddev: 0.1",
    FOOTPRINT: "height: 1.0",
    SCAN: "radius: 0.05, voxel: 0.1",
    CLOUD: "radius: 0.05, voxel: 0.1",
    GRID: "height: 2.0, unknown: unresolved",
    COSTMAP: "height: 2.0, unknown: unresolved",
    OCTOMAP: "threshold: 0.5",
    GRID_MAP: "layer: elevation",
}
"""The keys of an entry besides its topic. Sizes are to be replaced by the real ones."""

NOTHING: Final = "objects: {}             # no topic of a known type is there; `run --sources` needs an object here"
"""The line of a file without an entry, which a node would refuse."""

_SIZED: Final = (ODOMETRY, POSE, POSE_WITH_COVARIANCE)


class Seen(NamedTuple):
    """A topic on the graph. namespaces: of its markers. moved: those of them that moved while somebody listened."""

    topic: str
    type: str
    frames: tuple[str, ...] = ()
    namespaces: tuple[str, ...] = ()
    moved: frozenset[str] = frozenset()


def sources_file(topics: Iterable[Seen], parents: dict[str, str]) -> str:
    """Return the text of a sources file. parents: the parent of each tf frame."""
    given = list(topics)
    frames = [frame for each in given for frame in each.frames if frame]
    roots = sorted({*parents.values()} - parents.keys())
    frame = next(
        (name for name in ("map", "world", "odom") if name in [*roots, *frames]), (roots or frames or ["map"])[0]
    )
    lines = [f"frame: {frame}", "rate: 20                # Hz of the steps", "objects:"]
    used: set[str] = set()
    for each in given:
        if each.type in (MARKER, MARKERS):
            for namespace in each.namespaces:
                name = _name(namespace or each.topic, used)
                still = "" if namespace in each.moved else ", static: true"
                note = "   # they did not move" if still else ""
                lines.append(f"  {name}: {{topic: {each.topic}, marker: {{ns: {namespace!r}}}{still}}}{note}")
        elif each.type in _ENTRIES:
            note = "   # its real shape, in m" if each.type in _SIZED else ""
            lines.append(f"  {_name(each.topic, used)}: {{topic: {each.topic}, {_ENTRIES[each.type]}}}{note}")
    for child in sorted(parents.keys() - {*parents.values()}):
        lines.append(
            f"  # {_name(child, used)}: {{topic: /tf, frame: {child}, shape: {{sphere: 0.3}}}}   # a frame of tf"
        )
    robots = robot_lines((each.topic, each.type) for each in given)
    if not robots:  # the world of a planning scene alone
        scenes = [each.topic for each in given if each.type in (PLANNING_SCENE, COLLISION_OBJECT)]
        lines += [f"  {_name(topic, used)}: {{topic: {topic}}}" for topic in scenes]
    if all(line.lstrip().startswith("#") for line in lines[3:]):  # frames of tf, if anything
        lines[2] = "# objects:" if robots else NOTHING
    lines += robots
    return "\n".join(lines) + "\n"


def _name(topic: str, used: set[str]) -> str:
    """Return a name for an entry that no other one has."""
    base = name = "_".join(part for part in topic.split("/") if part) or "object"
    number = 2
    while name in used:
        name, number = f"{base}_{number}", number + 1
    used.add(name)
    return name
