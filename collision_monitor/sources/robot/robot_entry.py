"""An entry of `robots:` in a sources file.

robots:
  arm:
    urdf: package://arm_description/urdf/arm.urdf    # or a path, or `urdf_topic: /robot_description`; or a xacro file
    arguments: {prefix: left_}                       # of a xacro file
    srdf: arm.srdf                                   # or `srdf_topic: /robot_description_semantic`; may be left out
    packages: {arm_description: ../arm}              # folders of packages that are not installed
    joint_states: /joint_states
    base: {frame: base_link}                         # a frame of tf; without `base` the one with the base link's name
    # base: {odometry: /odom}                        # the pose of its child_frame_id, a link; or name it, `link: …`
    # base: {pose: [1, 0, 0.8]}                      # where it is bolted, in `frame` or else in the monitor's frame
    plan: /arm_controller/joint_trajectory           # JointTrajectory, or MoveIt's DisplayTrajectory
    planning_scene: /monitored_planning_scene        # of MoveIt: its world, attached objects, padding, allowed pairs
    padding: 0.01
    model: convex_hull                               # what represents the links, as in ObjectDescription
    allowed: {base: [floor]}                         # contacts of a link with other objects that are expected
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from collision_monitor.errors import InputError
from collision_monitor.records import Model
from collision_monitor.robots.mesh_location import FileLocator
from collision_monitor.robots.robot import Description
from collision_monitor.robots.xacro_file import ENDING
from collision_monitor.shapes.pose import Pose
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.yaml_table import known, number, pose, table, text

_KEYS: Final = (
    *("urdf", "urdf_topic", "srdf", "srdf_topic", "packages", "arguments", "joint_states", "base"),
    *("planning_scene", "padding", "group", "mask", "model", "allowed", "motion", "plan"),
)
JOINTS, ARC = "joints", "arc"
_BASE: Final = ("frame", "odometry", "link", "pose")
_MODELS: Final = tuple(model.name.lower() for model in Model)


@dataclass(frozen=True)
class BaseEntry:
    """Where the base is.

    odometry: its topic, or empty. frame: of tf; empty: by the link's name. link: the one that is there; empty: the base
    link. pose: in `frame`; None: none is given.
    """

    frame: str = ""
    odometry: str = ""
    link: str = ""
    pose: Pose | None = None


@dataclass(frozen=True)
class RobotEntry:
    """A robot of the file. urdf, srdf: None if a topic holds it. allowed: ids of objects by the name of a link.

    motion: JOINTS, the links are predicted along their joints, or ARC, along their twists.
    """

    name: str
    urdf: Description | None
    srdf: Description | None
    urdf_topic: str = ""
    srdf_topic: str = ""
    packages: dict[str, Path] = field(default_factory=dict)
    joint_states: str = ""
    base: BaseEntry = BaseEntry()
    planning_scene: str = ""
    plan: str = ""
    padding: float = 0.0
    group: int = 1
    mask: int = 0
    model: Model = Model.AUTO
    allowed: dict[str, list[int]] = field(default_factory=dict)
    motion: str = JOINTS


def read_robots(content: Any, mapping: Mapping) -> list[RobotEntry]:
    """Return the entries of `robots:`. Raises InputError."""
    if not isinstance(content, dict) or not content:
        raise InputError(f"robots: expected a table of names, got {content!r}")
    taken = {entry.name for entry in mapping.sources}
    for name in content:
        if name in taken:
            raise InputError(f"{name}: expected a name that no object has")
    return [_robot(str(name), table(each, str(name), _KEYS), mapping) for name, each in content.items()]


def _robot(name: str, content: dict[str, Any], mapping: Mapping) -> RobotEntry:
    given = {key: text(content.get(key, ""), f"{name}, {key}") for key in _KEYS[:4]}
    topics = {key: text(content.get(key, ""), f"{name}, {key}") for key in ("joint_states", "planning_scene", "plan")}
    if bool(given["urdf"]) == bool(given["urdf_topic"]):
        raise InputError(f"{name}, urdf: expected `urdf: FILE` or `urdf_topic: TOPIC`, got both or none")
    if given["srdf"] and given["srdf_topic"]:
        raise InputError(f"{name}, srdf: expected `srdf: FILE` or `srdf_topic: TOPIC`, got both")
    folder = Path(mapping.path).parent
    packages = content.get("packages", {})
    if not isinstance(packages, dict):
        raise InputError(f"{name}, packages: expected a table of folders by package, got {packages!r}")
    folders = {str(key): folder / text(value, f"{name}, packages") for key, value in packages.items()}
    arguments = content.get("arguments", {})
    if not isinstance(arguments, dict) or (arguments and not given["urdf"].endswith(ENDING)):
        raise InputError(f"{name}, arguments: expected a table of values of a xacro file, got {arguments!r:.100} "
                         f"for {given['urdf']!r:.100}")  # fmt: skip
    files = FileLocator(folder, folders)
    model = content.get("model", "auto")
    if model not in _MODELS:
        raise InputError(f"{name}, model: expected one of {', '.join(_MODELS)}, got {model!r}")
    motion = content.get("motion", JOINTS)
    if motion not in (JOINTS, ARC):
        raise InputError(f"{name}, motion: expected {JOINTS} or {ARC}, got {motion!r:.80}")
    return RobotEntry(
        name=name,
        motion=motion,
        urdf=_description(given["urdf"], f"{name}, urdf", files, _words(arguments), folders),
        srdf=_description(given["srdf"], f"{name}, srdf", files, {}, folders),
        urdf_topic=given["urdf_topic"],
        srdf_topic=given["srdf_topic"],
        packages=folders,
        base=_base(name, content.get("base", {})),
        padding=number(content.get("padding", 0.0), f"{name}, padding", "m"),
        group=content.get("group", 1),
        mask=content.get("mask", 0),
        model=Model[model.upper()],
        allowed=_allowed(name, content.get("allowed", {}), mapping),
        **topics,
    )


def _words(arguments: dict[Any, Any]) -> dict[str, str]:
    """Values as xacro takes them: YAML's truth as true and false."""
    return {str(key): str(value).lower() if isinstance(value, bool) else str(value) for key, value in arguments.items()}


def _description(
    address: str, what: str, files: FileLocator, arguments: dict[str, str], packages: dict[str, Path]
) -> Description | None:
    if not address:
        return None
    try:
        return Description.read(files.find(address), arguments, packages)
    except InputError as error:
        raise InputError(f"{what}: {error}") from None


def _base(name: str, value: Any) -> BaseEntry:
    content = table(value, f"{name}, base", _BASE)
    words = {key: text(content.get(key, ""), f"{name}, base, {key}") for key in _BASE[:3]}
    if words["odometry"] and (words["frame"] or "pose" in content):
        raise InputError(f"{name}, base: expected `odometry`, or `frame` and `pose`, got both")
    at = pose(content["pose"], f"{name}, base, pose") if "pose" in content else None
    return BaseEntry(words["frame"].removeprefix("/"), words["odometry"], words["link"], at)


def _allowed(name: str, value: Any, mapping: Mapping) -> dict[str, list[int]]:
    if not isinstance(value, dict) or not all(isinstance(others, list) for others in value.values()):
        example = "{base: [floor]}"
        raise InputError(f"{name}, allowed: expected lists of objects by link, such as {example}, got {value!r}")
    ids = {entry.name: entry.object_id for entry in mapping.sources}
    for others in value.values():
        for other in others:
            known(str(other), list(ids), f"{name}, allowed")
    return {str(link): [ids[str(other)] for other in others] for link, others in value.items()}
