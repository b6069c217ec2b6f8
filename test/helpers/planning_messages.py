"""Messages of MoveIt's planning scenes, and feeds that take them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from played_sources import START, Played
from ros_messages import header, message, pose

ARM = Path(__file__).parents[2] / "examples/arm/arm.urdf"
SCENE, OBJECT = "moveit_msgs/msg/PlanningScene", "moveit_msgs/msg/CollisionObject"
ADD, REMOVE, APPEND, MOVE = range(4)
ROBOT: dict[str, Any] = {
    "urdf": str(ARM), "joint_states": "/joint_states", "base": {"pose": [1, 2, 0.5]}, "planning_scene": "/scene",
}  # fmt: skip


def solid(kind: int, *dimensions: float, outline: Any = ()) -> Any:
    polygon = message(
        "geometry_msgs/msg/Polygon",
        points=[message("geometry_msgs/msg/Point32", x=float(x), y=float(y)) for x, y in outline],
    )
    return message("shape_msgs/msg/SolidPrimitive", type=kind, dimensions=np.array(dimensions, float), polygon=polygon)


def an_object(name: str, *solids: Any, frame: str = "map", at: Any = None, operation: int = ADD, **fields: Any) -> Any:
    return message(
        OBJECT,
        header=header(frame, START),
        id=name,
        operation=operation,
        primitives=list(solids),
        primitive_poses=fields.pop("primitive_poses", [pose() for _ in solids]),
        pose=at or pose(),
        **fields,
    )


def attached(link: str, content: Any, *touch: str) -> Any:
    return message("moveit_msgs/msg/AttachedCollisionObject", link_name=link, object=content, touch_links=list(touch))


def a_scene(*objects: Any, held: Any = (), is_diff: bool = True, **fields: Any) -> Any:
    return message(
        SCENE,
        is_diff=is_diff,
        world=message("moveit_msgs/msg/PlanningSceneWorld", collision_objects=list(objects)),
        robot_state=message("moveit_msgs/msg/RobotState", attached_collision_objects=list(held), is_diff=is_diff),
        **fields,
    )


def matrix(names: list[str], rows: Any, **defaults: bool) -> Any:
    entries = [message("moveit_msgs/msg/AllowedCollisionEntry", enabled=np.array(row, np.bool_)) for row in rows]
    return message(
        "moveit_msgs/msg/AllowedCollisionMatrix",
        entry_names=names,
        entry_values=entries,
        default_entry_names=list(defaults),
        default_entry_values=np.array(list(defaults.values()), np.bool_),
    )


def with_world(**file: Any) -> Played:
    """Return a feed of a planning scene without a robot."""
    return Played(None, objects={"world": {"topic": "/scene", **file}})


def ready() -> tuple[Played, Any]:
    """Return a robot whose joints are known, with their values."""
    played = Played({**ROBOT, "srdf": str(ARM.with_suffix(".srdf"))})
    joints = np.column_stack([np.linspace(-1, 1, 8), np.linspace(2, -2, 8)])
    played.joints(START, *joints.T)
    return played, joints


def allowed_pairs(played: Played) -> set[tuple[str, str]]:
    names = {it.object_id: name.removeprefix("arm/") for name, it in played.objects.items()}
    pairs = ((names[it.object_id], names[other]) for it in played.objects.values() for other in it.allowed)
    return {(min(pair), max(pair)) for pair in pairs}
