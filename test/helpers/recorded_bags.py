"""Bags with odometry for the tests of their readers: MCAP with every option of a writer, and what is read of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from foreign_bag import SECOND, START, STORE, odometry
from mcap.writer import Writer as McapWriter

from collision_monitor.sources.bag import Bag

ODOM, KIND = "/odom", "nav_msgs/msg/Odometry"
STEP = SECOND // 50
STILL = ((0, 0, 0, 1), (0, 0, 0), (0, 0, 0))

Row = tuple[str, int, bytes]


def rows(count: int = 40, topic: str = ODOM) -> list[Row]:
    return [(topic, START + k * STEP, cdr(*odometry("map", START + k * STEP, (k, 0, 0), *STILL))) for k in range(count)]


def cdr(kind: str, message: Any) -> bytes:
    return bytes(STORE.serialize_cdr(message, kind))


def mcap(
    path: Path, messages: Iterable[Row], change: Callable[[McapWriter], None] = lambda _: None, **options: Any
) -> Path:
    """Write an MCAP file of odometry, with options of the library's writer. change: called before the messages."""
    with path.open("wb") as stream:
        writer = McapWriter(stream, **options)
        writer.start("ros2", "another program")
        schema = writer.register_schema(KIND, "ros2msg", b"")
        channels: dict[str, int] = {}
        change(writer)
        for topic, time, data in messages:
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], time, data, time, 0)
        writer.finish()
    return path


def read(path: Path, *topics: str) -> list[Row]:
    with Bag(path) as bag:
        return [(each.topic, each.received, each.data) for each in bag.messages(topics or [ODOM])]
