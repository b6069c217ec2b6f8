"""Messages of other programs for the fuzzer of the sources: of each type a valid one, and what may be wrong with it.

(seed, index) determine each message, up to the time that it is sent at. A valid message is changed by its fields: any
number, text, length or stamp may become one that nobody should send. The bytes may be damaged besides.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from dice import LONGEST_NAME, WORDS, Dice
from foreign_bag import STORE, T, marker, markers, odometry, pose_stamped, transforms
from foreign_messages import (
    detection,
    detections,
    footprint,
    laser_scan,
    point_cloud,
    predicted_objects,
    track,
    tracked_objects,
)
from message_fuzzer import spoiled, stamp
from ros_messages import header, message, point, pose
from rosbags.interfaces import Nodetype

SECOND: Final = 1_000_000_000

ARM_JOINTS: Final = (*(f"joint_{k}" for k in range(1, 8)), "finger_joint")

FRAMES: Final = ("map", "odom", "base", "sensor", "nowhere")
LARGEST_ARRAY: Final = 3000
"""Elements to which a sequence may be repeated."""

URDF: Final = """<robot name="r"><link name="a"><collision><geometry><box size="1 1 {}"/></geometry></collision></link>
<joint name="joint_1" type="{}"><parent link="a"/><child link="b"/><axis xyz="0 0 {}"/>{}</joint>
<link name="b"><collision><geometry>{}</geometry></collision></link></robot>"""
GEOMETRIES: Final = (
    *('<sphere radius="0.2"/>', '<mesh filename="part.stl"/>', f'<mesh filename="{"n" * 300}.stl"/>', "<cone/>"),
    *('<mesh filename="/nowhere/x/y.stl"/>', '<mesh filename="package://a/b.stl"/>', '<box size="0 0 0"/>'),
)

Typed = tuple[str, Any]
"""Name of a type, and a message of it."""


class SourceMessage(NamedTuple):
    """A message of an attack, as DDS or a bag delivers it."""

    topic: str
    type: str
    data: bytes


def hostile_source_message(seed: int, index: int, now_ns: int) -> SourceMessage:
    """Return message `index` of a seed, sent at `now_ns`."""
    dice = Dice(seed, index)
    topic = dice.random.choice(tuple(MAKERS))
    kind, content = MAKERS[topic](dice, now_ns)
    if dice.wild:
        content = _changed(dice, kind, copy.deepcopy(content), now_ns)
    data = _bytes(kind, content) or _tame_bytes(topic, now_ns)  # a number that its field cannot hold
    if dice.is_hostile or dice.chance(0.03):
        data = spoiled(dice, data, _tame_bytes(dice.random.choice(tuple(MAKERS)), now_ns))
    return SourceMessage(topic, kind, data)


def _tame_bytes(topic: str, now_ns: int) -> bytes:
    """Return a valid message of a topic, with a stamp of now."""
    dice = Dice(0, 0)
    dice.wild = 0.0
    kind, content = MAKERS[topic](dice, min(now_ns, (2**31 - 2) * SECOND))
    return bytes(STORE.serialize_cdr(content, kind))


def _bytes(kind: str, content: Any) -> bytes | None:
    try:
        return bytes(STORE.serialize_cdr(content, kind))
    except Exception:
        return None


# -- valid messages


def _frame(dice: Dice) -> str:
    return dice.random.choice(FRAMES[:4]) if dice.chance(0.3) else "map"


def _place(dice: Dice) -> list[float]:
    return [dice.random.uniform(-20, 20) for _ in range(3)]


def _turn(dice: Dice) -> list[float]:
    q = np.array([dice.random.gauss(0, 1) for _ in range(4)])
    return list(q / np.linalg.norm(q)) if dice.chance(0.5) else [0.0, 0.0, 0.0, 1.0]


def _odometry(dice: Dice, now: int) -> Typed:
    message_ = odometry(_frame(dice), stamp(dice, now), _place(dice), _turn(dice), _place(dice), (0, 0, 0.1))
    message_[1].child_frame_id = "base"
    if dice.chance(0.3):
        for part in (message_[1].pose, message_[1].twist):
            part.covariance = np.diag([dice.number(0, 0.1)] * 6).ravel()
    return message_


def _pose(dice: Dice, now: int) -> Typed:
    return pose_stamped(_frame(dice), stamp(dice, now), _place(dice), _turn(dice))


def _pose_with_covariance(dice: Dice, now: int) -> Typed:
    inner = pose_stamped(_frame(dice), stamp(dice, now), _place(dice), _turn(dice))[1]
    covariance = T["geometry_msgs/msg/PoseWithCovariance"](inner.pose, np.diag([dice.number(0, 1)] * 6).ravel())
    kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
    return kind, T[kind](inner.header, covariance)


def _transforms(dice: Dice, now: int) -> Typed:
    names = (*FRAMES[1:4], *(f"f{dice.random.randrange(40)}" for _ in range(3)))
    count = dice.random.choice((0, 1, 2, 3, 20))
    choose = dice.random.choice
    links = [(choose(("map", *names)), choose(names), _place(dice), _turn(dice)) for _ in range(count)]
    return transforms(stamp(dice, now), *links)


def _marker(dice: Dice, now: int) -> Any:
    scale = dice.random.choice(((1, 1, 1), (0.5, 0.5, 2), (0, 0, 0), (1, 2, 0)))
    kind, action = dice.random.choice((1, 1, 2, 3, 4, 10)), dice.random.choices((0, 2, 3, 1), (85, 8, 5, 2))[0]
    namespace = dice.random.choice(("a", "b", "", "other"))
    return marker(
        namespace, dice.random.randrange(30), kind, scale, _place(dice), frame=_frame(dice), stamp=stamp(dice, now),
        action=action,
    )  # fmt: skip


def _markers(dice: Dice, now: int) -> Typed:
    return markers(*(_marker(dice, now) for _ in range(dice.random.choice((0, 1, 3, 12)))))


def _tracks(dice: Dice, now: int, make: Callable[..., Typed], *, predicted: bool) -> Typed:
    corners = [(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)][: dice.random.choice((4, 4, 4, 3, 2, 1, 0))]
    each = [
        track(
            dice.random.randrange(40), _place(dice), _turn(dice), _place(dice), kind=dice.random.choice((0, 1, 2, 2)),
            size=[dice.random.choice((1.0, 2.0, 0.0)) for _ in range(3)], footprint=corners, predicted=predicted,
            label=dice.random.randrange(14), orientation=dice.random.randrange(3), existence=dice.random.random(),
        )
        for _ in range(dice.random.choice((0, 1, 4, 15)))
    ]  # fmt: skip
    return make(_frame(dice), stamp(dice, now), *each)


def _detections(dice: Dice, now: int) -> Typed:
    count = dice.random.choice((0, 1, 5, 30))
    each = [detection(_place(dice), name=dice.random.choice(("", "", "7", "9")), variance=0.01) for _ in range(count)]
    return detections(_frame(dice), stamp(dice, now), *each)


def _footprint(dice: Dice, now: int) -> Typed:
    rings: tuple[Any, ...] = (
        ((1, 1), (-1, 1), (-1, -1), (1, -1)),
        ((0, 0), (2, 0), (2, 2), (1, 0.5), (0, 2)),
        ((0, 0), (2, 0), (2, 2), (0, 0)),
        ((0, 0), (1, 0), (2, 0)),
        ((0, 0), (1, 1), (1, 0), (0, 1)),
        ((0, 0), (3, 0)),
        ((0, 0),),
    )
    return footprint(_frame(dice), stamp(dice, now), dice.random.choice(rings))


def _scan(dice: Dice, now: int) -> Typed:
    count = dice.random.choice((0, 1, 8, 360))
    ranges = [dice.random.choice((1.0, 3.0, np.inf, np.nan, -np.inf, 0.0)) for _ in range(count)]
    return laser_scan(_frame(dice), stamp(dice, now), ranges, step=dice.random.choice((0.01, 0.5)))


def _cloud(dice: Dice, now: int) -> Typed:
    count = dice.random.choice((0, 1, 30, 500))
    points = np.random.default_rng(dice.random.randrange(1 << 30)).uniform(-10, 10, (count, 3))
    if count and dice.chance(0.2):
        points[0] = np.nan
    return point_cloud(_frame(dice), stamp(dice, now), points)


def _solid(dice: Dice) -> Any:
    kind = dice.random.randrange(1, 6)
    sizes = {1: 3, 2: 1, 3: 2, 4: 2, 5: 1}[kind]
    outline = [message("geometry_msgs/msg/Point32", x=x, y=y) for x, y in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))]
    polygon = message("geometry_msgs/msg/Polygon", points=outline)
    return message("shape_msgs/msg/SolidPrimitive", type=kind, dimensions=np.full(sizes, 0.5), polygon=polygon)


def _mesh() -> Any:
    triangle = message("shape_msgs/msg/MeshTriangle", vertex_indices=np.array([0, 1, 2], np.uint32))
    return message("shape_msgs/msg/Mesh", triangles=[triangle], vertices=[point(*row) for row in np.eye(3)])


def _object(dice: Dice, now: int) -> Typed:
    kind = "moveit_msgs/msg/CollisionObject"
    solids = [_solid(dice) for _ in range(dice.random.choice((0, 1, 1, 3)))]
    poses = [pose(_place(dice), _turn(dice)) for _ in range(dice.random.choice((0, len(solids), len(solids))))]
    return kind, message(
        kind,
        header=header(_frame(dice), now),
        id=dice.random.choice(("table", "cup", "wall", "")),
        operation=dice.random.choices((0, 1, 2, 3), (70, 10, 10, 10))[0],
        primitives=solids,
        primitive_poses=poses,
        meshes=[_mesh()] if dice.chance(0.2) else [],
        planes=[message("shape_msgs/msg/Plane", coef=np.array([0.0, 0.0, 1.0, 0.0]))] if dice.chance(0.1) else [],
        pose=pose(_place(dice), _turn(dice) if dice.chance(0.8) else (0, 0, 0, 0)),
    )


def _scene(dice: Dice, now: int) -> Typed:
    kind = "moveit_msgs/msg/PlanningScene"
    is_diff = dice.chance(0.7)
    held = [
        message(
            "moveit_msgs/msg/AttachedCollisionObject",
            link_name=dice.random.choice(("hand", "hand", "forearm", "tail", "")),
            object=_object(dice, now)[1],
            touch_links=["left_finger"] if dice.chance(0.5) else [],
        )
        for _ in range(dice.random.choice((0, 0, 1, 2)))
    ]
    names = ["hand", "table", "forearm"][: dice.random.randrange(4)]
    rows = [
        message("moveit_msgs/msg/AllowedCollisionEntry", enabled=np.array([dice.chance(0.5) for _ in names], np.bool_))
        for _ in names
    ]
    matrix = message("moveit_msgs/msg/AllowedCollisionMatrix", entry_names=names, entry_values=rows)
    return kind, message(
        kind,
        is_diff=is_diff,
        world=message(
            "moveit_msgs/msg/PlanningSceneWorld",
            collision_objects=[_object(dice, now)[1] for _ in range(dice.random.choice((0, 1, 3)))],
        ),
        robot_state=message("moveit_msgs/msg/RobotState", attached_collision_objects=held, is_diff=is_diff),
        allowed_collision_matrix=matrix,
        link_padding=[message("moveit_msgs/msg/LinkPadding", link_name="hand", padding=0.01)] if is_diff else [],
        link_scale=[message("moveit_msgs/msg/LinkScale", link_name="hand", scale=1.5)] if dice.chance(0.2) else [],
    )


def _joints(dice: Dice, now: int) -> Typed:
    kind = "sensor_msgs/msg/JointState"
    names = list(ARM_JOINTS[: dice.random.choice((8, 8, 7, 1, 0))])
    values = [dice.random.uniform(-1, 1) for _ in names]
    velocity = np.array(values if dice.chance(0.7) else [], np.float64)
    fields = {"name": names, "position": np.array(values, np.float64), "velocity": velocity}
    return kind, message(kind, header=header("", stamp(dice, now)), **fields)


def _urdf(dice: Dice, now: int) -> Typed:
    mimic = '<mimic joint="joint_1"/>' if dice.chance(0.1) else ""
    size, axis = dice.number(0.1, 2.0), dice.number(-1, 1)
    kind = dice.random.choice(("revolute", "fixed", "continuous", "prismatic", "floating", "wrong"))
    text = URDF.format(size, kind, axis, mimic, dice.random.choice(GEOMETRIES))
    if dice.is_hostile:
        at = dice.random.randrange(len(text))
        text = text[:at] + dice.text() + text[at + dice.random.randrange(20) :]
    return "std_msgs/msg/String", message("std_msgs/msg/String", data=text)


def _srdf(dice: Dice, now: int) -> Typed:
    text = '<robot name="r"><disable_collisions link1="a" link2="b"/></robot>'
    if dice.is_hostile:
        text = text.replace("link1", dice.random.choice(("link3", "", "link1='x' y")))
    return "std_msgs/msg/String", message("std_msgs/msg/String", data=text)


MAKERS: Final[dict[str, Callable[[Dice, int], Typed]]] = {
    "/odom": _odometry,
    "/pose": _pose,
    "/pose_with_covariance": _pose_with_covariance,
    "/tf": _transforms,
    "/tf_static": _transforms,
    "/marker": lambda dice, now: ("visualization_msgs/msg/Marker", _marker(dice, now)),
    "/markers": _markers,
    "/tracked": lambda dice, now: _tracks(dice, now, tracked_objects, predicted=False),
    "/predicted": lambda dice, now: _tracks(dice, now, predicted_objects, predicted=True),
    "/detections": _detections,
    "/footprint": _footprint,
    "/scan": _scan,
    "/cloud": _cloud,
    "/world": _scene,
    "/object": _object,
    "/joint_states": _joints,
    "/base_odom": _odometry,
    "/arm_scene": _scene,
    "/robot_description": _urdf,
    "/srdf": _srdf,
}
"""By topic, what makes a valid message of it."""


# -- what may be wrong


def _changed(dice: Dice, kind: str, content: Any, now: int) -> Any:
    """Return a message with some of its fields changed, each with the share `dice.wild`."""
    if kind == "builtin_interfaces/msg/Time" and dice.is_hostile:
        content.sec = dice.random.choice((0, 1, -1, 2**31 - 1, -(2**31), now // SECOND, now // SECOND - 3))
        content.nanosec = dice.random.choice((0, 1, 999_999_999, 1_000_000_000, 2**32 - 1))
        return content
    for name, (node, detail) in STORE.fielddefs[kind][1]:
        setattr(content, name, _changed_field(dice, node, detail, getattr(content, name), now))
    return content


def _changed_field(dice: Dice, node: Any, detail: Any, value: Any, now: int) -> Any:
    if node == Nodetype.NAME:
        return _changed(dice, detail, value, now)
    if node == Nodetype.BASE:
        return _wrong_value(dice, detail[0], value) if dice.is_hostile else value
    (element, inner), _ = detail
    if isinstance(value, np.ndarray):
        return _changed_array(dice, value, fixed=node == Nodetype.ARRAY)
    found = [_changed_field(dice, element, inner, each, now) for each in value]
    if node == Nodetype.SEQUENCE and dice.is_hostile:
        return _another_length(dice, found)
    return found


def _another_length(dice: Dice, values: list[Any]) -> list[Any]:
    kind = dice.random.randrange(4)
    if kind == 0 or not values:
        return []
    if kind == 1:
        return values[: dice.random.randrange(len(values))]
    if kind == 2:
        return [*values, copy.copy(values[0])]  # twice
    return values * (min(LARGEST_ARRAY, 200_000 // (1 + len(repr(values[0])))) // len(values) + 1)


def _wrong_value(dice: Dice, kind: str, value: Any) -> Any:
    if kind == "string":
        long = "n" * dice.random.choice((LONGEST_NAME, LONGEST_NAME + 1, 10_000, 1_000_000))
        return dice.random.choice((*WORDS, *FRAMES, long if dice.chance(0.1) else "n" * 300))
    if kind == "bool":
        return not value
    if kind.startswith("float"):
        wrong = dice.hostile()
        return wrong if kind == "float64" or not abs(wrong) > 3e38 else float("inf")
    bits = int(kind.removeprefix("uint").removeprefix("int").replace("byte", "8").replace("char", "8") or 8)
    signed = kind.startswith("int")
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    near = (low, high, 0, 1, 2, high // 2, high - 3, high // 2 - 3, dice.random.randint(low, high))
    return dice.random.choice(near)


def _changed_array(dice: Dice, values: Any, *, fixed: bool) -> Any:
    if not dice.is_hostile:
        return values
    if not fixed and dice.chance(0.5):
        length = dice.random.choice((0, 1, max(len(values) - 1, 0), len(values) + 1, LARGEST_ARRAY))
        return np.resize(values, length) if len(values) else np.zeros(length, values.dtype)
    changed = values.copy()
    for _ in range(min(len(values), dice.random.choice((1, 3, len(values))))):
        at = dice.random.randrange(len(values))
        if changed.dtype.kind == "f":
            with np.errstate(over="ignore"):
                changed[at] = dice.hostile()
        elif changed.dtype.kind == "b":
            changed[at] = not changed[at]
        else:
            info = np.iinfo(changed.dtype)
            changed[at] = dice.random.choice((info.min, info.max, 0, info.max // 2))
    return changed
