"""A structure-aware fuzzer of messages. (seed, index) determine each message, up to the time that it is sent at."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from dice import Dice
from hostile_shapes import any_shape

from collision_monitor.codec import encode_parameter_event
from collision_monitor.codec.cdr import ENCAPSULATION, Writer
from collision_monitor.codec.states import COVARIANCE_SIZE
from collision_monitor.errors import MessageError
from collision_monitor.pipeline.topics import Topic
from collision_monitor.records import STATE, Model
from collision_monitor.settings.profile import Profile

SECOND: Final = 1_000_000_000

FIRST_ID: Final = 1000
IDS: Final = 10
"""Ids of the attackers' objects: FIRST_ID and those behind it."""

REACH: Final = 10.0
"""m: where the attackers' objects mostly are. Larger: few of their pairs meet. Smaller: all of them do."""

SEEN_IDS: Final = 6
"""Ids from 0 on that a hostile message may claim: those of the known scene among them."""

FAR: Final = (0, SECOND, 10**9 * SECOND, (2**31 - 1) * SECOND, -(2**31) * SECOND, -SECOND)
"""ns: stamps that have nothing to do with now."""

NEAR: Final = (-3600, -100, -9, -1, -0.02, -1e-9, 0.0, 1e-9, 0.5, 3.0, 9.9, 11.0, 100.0, 3600.0, 1e8)
"""s: jumps of a stamp."""

LARGEST_VALUE: Final = {"threads": 3, "impact_iterations": 256, "uncertainty_samples": 64}
"""Largest values of settings that a user may choose so that a step takes long."""


class Message(NamedTuple):
    """One message of an attack. topic: where it arrives, which may be the wrong one."""

    topic: Topic
    data: bytes


def hostile_message(seed: int, index: int, now_ns: int) -> Message:
    """Return message `index` of a seed, sent at `now_ns`."""
    dice = Dice(seed, index)
    topic = dice.random.choices(list(_MAKERS), (67, 23, 3, 7))[0]
    data = _MAKERS[topic](dice, now_ns)
    if dice.is_hostile or dice.chance(0.05):
        other = _MAKERS[dice.random.choice((Topic.STATES, Topic.SHAPES))](dice, now_ns)
        data = spoiled(dice, data, other)
    if dice.is_hostile and dice.chance(0.1):
        topic = dice.random.choice(list(_MAKERS))
    return Message(topic, data)


def stamp(dice: Dice, now_ns: int) -> int:
    """Return a stamp: mostly a little after now, at times one that repeats, goes back or jumps."""
    if not (dice.is_hostile or dice.chance(0.05)):
        return now_ns + dice.random.randrange(1, 20_000_000)
    if dice.chance(0.3):
        return dice.random.choice(FAR) + dice.random.randrange(SECOND)
    return now_ns + round(dice.random.choice(NEAR) * SECOND)


def _object_id(dice: Dice) -> int:
    if dice.is_hostile and dice.chance(0.3):
        return dice.random.choice((dice.random.randrange(SEEN_IDS), dice.word()))
    return FIRST_ID + dice.random.randrange(IDS)


def _header(writer: Writer, dice: Dice, now_ns: int) -> None:
    seconds, nanoseconds = divmod(stamp(dice, now_ns), SECOND)
    if dice.is_hostile and dice.chance(0.1):
        nanoseconds = dice.word()
    writer.scalar("i4", min(max(seconds, -(2**31)), 2**31 - 1), "sec")
    writer.scalar("u4", nanoseconds, "nanosec")
    writer.string(dice.text() if dice.is_hostile and dice.chance(0.3) else "world", "frame_id")


# -- states


def states(dice: Dice, now_ns: int) -> bytes:
    """Return an ObjectStateArray."""
    count = dice.random.randrange(0, 12)
    if dice.is_hostile and dice.chance(0.05):
        count = dice.random.choice((0, 1, 300, 5000))
    rows = np.zeros(count, STATE)
    ids = [_object_id(dice) for _ in range(count)]
    if count and not dice.is_hostile:
        ids = sorted(set(ids)) + ids  # each once, as far as they go
    rows["id"] = ids[:count]
    rows["quaternion"][:, 3] = 1.0
    for row in rows[:40]:
        row["position"] = dice.numbers(3, -REACH, REACH)
        row["quaternion"] = dice.quaternion()
        row["linear"], row["angular"] = dice.numbers(3, -2.0, 2.0), dice.numbers(3, -1.0, 1.0)
        if dice.chance(0.1):
            row["acceleration"] = dice.numbers(3, -2.0, 2.0)
            row["flags"] = 2
        if dice.chance(0.02):
            for name in ("position_stddev", "orientation_stddev", "velocity_stddev", "angular_velocity_stddev"):
                row[name] = dice.number(0.0, 0.1)
        if dice.chance(0.2) or dice.is_hostile:
            row["flags"] = dice.random.choice((1, 4, 5, 7, dice.word()))
    covariance = np.empty(0)
    if dice.chance(0.03):
        covariance = np.tile([0.01, 0, 0, 0.01, 0, 0.01] * 2, count)
        for _ in range(5 if count and dice.is_hostile else 0):
            covariance[dice.random.randrange(len(covariance))] = dice.hostile()
        if dice.is_hostile:
            covariance = covariance[: dice.random.randrange(COVARIANCE_SIZE * count + 1)]
    writer = Writer("ObjectStateArray")
    _header(writer, dice, now_ns)
    writer.scalar("u4", dice.word() if dice.is_hostile else 0, "sequence")
    writer.sequence(rows, STATE, 8)
    writer.sequence(covariance, "<f8", 8)
    return writer.finish()


# -- shapes


def descriptions(dice: Dice, now_ns: int) -> bytes:
    """Return an ObjectDescriptionArray."""
    writer = Writer("ObjectDescriptionArray")
    _header(writer, dice, now_ns)
    writer.scalar("u1", dice.is_hostile and dice.chance(0.3), "snapshot")
    count = dice.random.choices((0, 1, 2, 4), (2, 85, 10, 3))[0]
    writer.scalar("u4", count, "objects")
    for _ in range(count):
        _description(writer, dice)
    return writer.finish()


def _description(writer: Writer, dice: Dice) -> None:
    object_id = _object_id(dice)
    shapes = [any_shape(dice) for _ in range(dice.random.choices((1, 2, 5), (90, 9, 1))[0])]
    if dice.is_hostile and dice.chance(0.1):
        shapes = []
    writer.scalar("u4", object_id, "id")
    writer.scalar("u1", dice.word(8) if dice.is_hostile and dice.chance(0.3) else int(dice.chance(0.15)), "operation")
    writer.string(dice.text(), "name")
    writer.scalar("u4", len(shapes), "shapes")
    for shape in shapes:
        shape.write(writer)
    poses = dice.random.choice((0, len(shapes)))
    if dice.is_hostile and dice.chance(0.2):
        poses = dice.random.randrange(8)
    writer.scalar("u4", poses, "shape_poses")
    for _ in range(poses):
        writer.raw(np.array(dice.pose(1.0), "<f8").tobytes(), 8)
    writer.scalar("u1", dice.chance(0.3), "is_static")
    writer.raw(np.array(dice.pose(REACH), "<f8").tobytes(), 8)
    for what in ("group", "mask"):
        writer.scalar("u4", dice.word() if dice.chance(0.2) else 0, what)
    writer.sequence(np.array(_allowed_ids(dice, object_id), "<u4"), "<u4", 4)
    writer.scalar("f8", dice.number(0.0, 0.2) if dice.chance(0.3) else 0.0, "padding")
    writer.scalar("u1", _model(dice), "model")
    for what in ("max_linear_acceleration", "max_angular_acceleration"):
        writer.scalar("f8", dice.number(0.0, 3.0) if dice.chance(0.3) else 0.0, what)


def _allowed_ids(dice: Dice, object_id: int) -> list[int]:
    if dice.is_hostile and dice.chance(0.1):
        return [dice.word() for _ in range(dice.random.choice((3, 500)))]
    return [dice.random.choice((object_id, _object_id(dice))) for _ in range(3 if dice.chance(0.1) else 0)]


def _model(dice: Dice) -> int:
    if dice.is_hostile and dice.chance(0.2):
        return dice.random.choice((11, 12, 128, 255))
    return int(dice.random.choice(list(Model))) if dice.chance(0.4) else 0


# -- plans


def plans(dice: Dice, now_ns: int) -> bytes:
    """Return an ObjectTrajectoryArray for the attackers' objects: the answers to the known scene stay the same."""
    writer = Writer("ObjectTrajectoryArray")
    _header(writer, dice, now_ns)
    count = dice.random.choices((0, 1, 3), (2, 88, 10))[0]
    writer.scalar("u4", count, "trajectories")
    for _ in range(count):
        points = dice.random.choices((0, 1, 2, 8), (5, 2, 40, 53))[0]
        if dice.is_hostile and dice.chance(0.05):
            points = 3000
        with np.errstate(all="ignore"):
            times = np.cumsum([dice.number(0.05, 0.5) for _ in range(points)]) - dice.number(0.0, 0.5)
        poses = [dice.pose(REACH) for _ in range(points - (dice.is_hostile and dice.chance(0.1)))]
        twists = [dice.numbers(6, -2.0, 2.0) for _ in range(points if dice.chance(0.4) else 0)]
        # polite curves are short: each span of one between random poses has 64 pieces, see docs/limits.md
        between = dice.word(8) if dice.is_hostile else dice.random.randrange(3 if twists and points < 3 else 2)
        bent = between == 2 or dice.is_hostile
        accelerations = [dice.numbers(6, -2.0, 2.0) for _ in range(points if bent and dice.chance(0.5) else 0)]
        for rows in (times, poses, twists, accelerations):
            writer.scalar("u4", len(rows), "length")
            if len(rows):
                writer.raw(np.array(rows, "<f8").tobytes(), 8)
        wide = dice.random.choice((0.0, 1.0, 100.0))
        writer.raw(np.array([wide * dice.number(0.01, 1.0) for _ in range(4)], "<f8").tobytes(), 8)
        writer.scalar("f8", dice.number(0.0, 0.05) if dice.chance(0.3) else 0.0, "tube")
        writer.scalar("u4", FIRST_ID + dice.random.randrange(IDS), "id")
        writer.scalar("u1", between, "between")
        writer.scalar("u1", dice.word(8) if dice.is_hostile else dice.random.randrange(2), "then")
    return writer.finish()


# -- settings


def settings(dice: Dice, now_ns: int) -> bytes:
    """Return a ParameterEvent with values of settings in and out of their ranges, of other types and names."""
    changed: dict[str, object] = {}
    for setting in dice.random.sample(Profile.fields(), dice.random.randrange(1, 4)):
        value: object = setting.default
        largest = LARGEST_VALUE.get(setting.name, setting.maximum)
        if setting.choices:
            value = dice.random.choice(setting.choices)
        elif setting.type is bool:
            value = dice.chance(0.5)
        elif setting.type in (int, float):
            value = setting.type(dice.random.choice((setting.minimum, largest, setting.default, 1)))
        if dice.is_hostile:
            value = dice.random.choice((dice.hostile(), dice.word(63), dice.text(), True, dice.numbers(3, -9, 9), []))
        name = dice.text() if dice.is_hostile and dice.chance(0.2) else setting.name
        if name in LARGEST_VALUE and isinstance(value, int) and value > LARGEST_VALUE[name]:
            value = LARGEST_VALUE[name]
        changed[name] = value
    try:
        return encode_parameter_event(stamp(dice, now_ns), "", changed)
    except MessageError:  # a stamp that no message can hold
        return encode_parameter_event(0, "", changed)


_MAKERS: Final[dict[Topic, Callable[[Dice, int], bytes]]] = {
    Topic.STATES: states,
    Topic.SHAPES: descriptions,
    Topic.SETTINGS: settings,
    Topic.TRAJECTORIES: plans,
}


# -- bytes


def spoiled(dice: Dice, data: bytes, other: bytes) -> bytes:
    """Return the bytes cut, lengthened, spliced with another message, with flipped bits or with a length that lies."""
    at = dice.random.randrange(len(data) + 1)
    kind = dice.random.randrange(7)
    if kind == 0:
        return data[:at]
    if kind == 1:
        return data + dice.random.randbytes(dice.random.randrange(1, 64))
    if kind == 2:
        return data[:at] + other[dice.random.randrange(len(other) + 1) :]
    if kind == 3:
        return ENCAPSULATION[: dice.random.randrange(5)] + dice.random.randbytes(dice.random.randrange(200))
    changed = bytearray(data)
    if kind == 4 and changed:  # a length or any other word
        at = 4 * dice.random.randrange((len(changed) + 3) // 4)
        changed[at : at + 4] = dice.word().to_bytes(4, "little")
    elif kind == 5:
        del changed[at : at + dice.random.randrange(1, 16)]
    else:
        for _ in range(dice.random.choice((1, 1, 3, 30)) if changed else 0):
            changed[dice.random.randrange(len(changed))] ^= 1 << dice.random.randrange(8)
    return bytes(changed)
