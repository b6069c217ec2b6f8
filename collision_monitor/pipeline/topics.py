"""The monitor's node and its topics: names, messages and quality of service, in one place for all that use them."""

from __future__ import annotations

from enum import Enum
from typing import Final, NamedTuple

NODE: Final = "object_monitor"
"""The node's name unless it is remapped."""

PARAMETER_SECTION: Final = f"/**/{NODE}"
"""The section of a parameter file that is for the node, in whatever namespace."""

STATUS_PERIOD: Final = 50_000_000
"""ns between two statuses while steps arrive: 20 Hz is enough for people and supervisors, 1 kHz is not."""


LATCHED: Final = "transient_local"
"""The durability by which a late subscriber gets what was published before."""


class Quality(NamedTuple):
    """Quality of service: how many messages wait, and the policies as ROS 2 names them."""

    depth: int
    reliability: str = "reliable"
    durability: str = "volatile"


class Topic(Enum):
    """A topic of the node: its name below the node's own, its message and its quality of service."""

    SHAPES = "objects/shapes", "collision_monitor_msgs/msg/ObjectDescriptionArray", Quality(100, durability=LATCHED)
    """A monitor that starts after the publisher still learns every shape."""

    STATES = "objects/states", "collision_monitor_msgs/msg/ObjectStateArray", Quality(10, "best_effort")
    """Sensor data: an old state is worth nothing once a newer one is there. The depth rides out one slow step at
    1 kHz."""

    SETTINGS = "settings", "rcl_interfaces/msg/ParameterEvent", Quality(1000)
    """Only recorded: live, ROS has /parameter_events."""

    CONTACTS = "contacts", "collision_monitor_msgs/msg/ContactArray", Quality(10)
    PREDICTIONS = "predictions", "collision_monitor_msgs/msg/PredictedCollisionArray", Quality(10)
    """Contacts and predictions: none is lost on the way to a subscriber that keeps up."""

    STATUS = "status", "collision_monitor_msgs/msg/MonitorStatus", Quality(1, durability=LATCHED)
    """A new subscriber gets the last status at once."""

    MARKERS = "markers", "visualization_msgs/msg/MarkerArray", Quality(1)
    """A picture for people: the newest is enough."""

    def __init__(self, path: str, type_name: str, quality: Quality) -> None:
        self.path = path
        self.type_name = type_name
        self.quality = quality

    @property
    def message(self) -> str:
        """The name of the message without its package: `ContactArray`."""
        return self.type_name.rpartition("/")[2]

    @property
    def private(self) -> str:
        """The name as the node itself writes it: `~/contacts`."""
        return f"~/{self.path}"

    def of(self, node: str = NODE) -> str:
        """The full name: `/object_monitor/contacts`."""
        return f"/{node}/{self.path}"


RECORDED: Final = (Topic.SHAPES, Topic.STATES, Topic.SETTINGS, Topic.CONTACTS, Topic.PREDICTIONS, Topic.STATUS)
"""What the node records, in the order of a session's channels."""
