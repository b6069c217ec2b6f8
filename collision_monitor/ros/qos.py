"""The quality of service of each topic, the same for whoever publishes and whoever subscribes."""

from __future__ import annotations

from typing import Final

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

STATES: Final = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Sensor data: an old state is worth nothing once a newer one is there. The depth rides out one slow step at 1 kHz."""

SHAPES: Final = QoSProfile(
    depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
"""Latched: a monitor that starts after the publisher still learns every shape."""

ANSWERS: Final = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
"""Contacts and predictions: none is lost on the way to a subscriber that keeps up."""

STATUS: Final = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
"""Latched: whoever asks gets the last status at once."""

MARKERS: Final = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
"""A picture for people: the newest is enough."""
