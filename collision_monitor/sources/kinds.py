"""The kinds of sources: which class takes which message type, and which section of the sources file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.source import Source
from collision_monitor.sources.messages.autoware import PREDICTED, TRACKED, AutowareSource
from collision_monitor.sources.messages.clouds import CLOUD, SCAN, CloudSource
from collision_monitor.sources.messages.detections import DETECTIONS, DetectionSource
from collision_monitor.sources.messages.footprints import FOOTPRINT, FootprintSource
from collision_monitor.sources.messages.grid_maps import GRID_MAP, GridMapSource
from collision_monitor.sources.messages.grids import COSTMAP, GRID, GridSource
from collision_monitor.sources.messages.markers import MARKER, MARKERS, MarkerSource
from collision_monitor.sources.messages.octomaps import OCTOMAP, OctomapSource
from collision_monitor.sources.messages.poses import ODOMETRY, POSE, POSE_WITH_COVARIANCE, PoseSource
from collision_monitor.sources.messages.tf_objects import TRANSFORMS, FrameSource
from collision_monitor.sources.plans.path_source import make_plans
from collision_monitor.sources.plans.schedule_source import ScheduleSource
from collision_monitor.sources.robot.planning_scene import COLLISION_OBJECT, PLANNING_SCENE, planning_world
from collision_monitor.sources.robot.robot_section import make_robots

BY_TYPE: Final[dict[str, Callable[[ObjectEntry, str, Mapping], Source]]] = {
    ODOMETRY: PoseSource,
    POSE: PoseSource,
    POSE_WITH_COVARIANCE: PoseSource,
    TRANSFORMS: FrameSource,
    MARKER: MarkerSource,
    MARKERS: MarkerSource,
    PLANNING_SCENE: planning_world,
    COLLISION_OBJECT: planning_world,
    TRACKED: AutowareSource,
    PREDICTED: AutowareSource,
    DETECTIONS: DetectionSource,
    FOOTPRINT: FootprintSource,
    SCAN: CloudSource,
    CLOUD: CloudSource,
    GRID: GridSource,
    COSTMAP: GridSource,
    OCTOMAP: OctomapSource,
    GRID_MAP: GridMapSource,
}
"""Makes the source of an entry of `objects:` from the entry, the type of its topic, and the whole file. Raises
InputError for an entry that does not fit the type."""

_SECTIONS: Final[dict[str, Callable[[Any, Mapping], list[Source]]]] = {
    "robots": make_robots,
    "plans": make_plans,
}
"""Makes the sources of a section of the file, such as `robots`, from the content of that section, checked here, and the
rest of the file. Raises InputError. The name is also in `mapping.SECTIONS`."""


def beside_topics(mapping: Mapping) -> list[Source]:
    """Return the sources of a file that do not wait for the type of a topic: schedules, and sections.

    Raises InputError.
    """
    found: list[Source] = [ScheduleSource(each, each.schedule) for each in mapping.sources if each.schedule is not None]
    for name, content in mapping.sections.items():
        found += _SECTIONS[name](content, mapping)
    return found
