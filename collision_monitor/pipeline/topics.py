"""The monitor's node and its topics: names, messages and quality of service, defined once for all users."""

from __future__ import annotations

from enum import Enum
from typing import Final, NamedTuple

from collision_monitor.settings.parameter_file import NODE as NODE

STATUS_PERIOD: Final = 50_000_000
"""ns between two statuses while steps arrive: 20 Hz is enough for people and supervisors, and 1 kHz too much."""

RULES: Final = "~/rules"
"""Topic of a String with the rules of the alerts (YAML), from a latched publisher."""

RULES_IN_FORCE: Final = "~/rules_in_force"
"""Topic of a DiagnosticArray about the rules of the alerts, and whom each of them covers at this moment; latched."""

SPEED_SCALE: Final = "~/speed_scale"
"""Topic of a gate: how fast its plan goes on, from 0 to 1."""
CHECK_TRAJECTORY: Final = "~/check_trajectory"
"""Service of a gate."""
GUARD_STATE: Final = "~/state"
"""Topic of a String on which the guard, a node of its own, explains what it does with the commands."""

LATCHED: Final = "transient_local"
"""The durability that delivers earlier messages to a late subscriber."""


_OBJECTS: Final = "collision_monitor_msgs/msg/ObjectDescriptionArray"
_PLANS: Final = "collision_monitor_msgs/msg/ObjectTrajectoryArray"
_OBJECT_STATES: Final = "collision_monitor_msgs/msg/ObjectStateArray"


class Quality(NamedTuple):
    """Quality of service: depth of the queue, and the policies by their ROS 2 names."""

    depth: int
    reliability: str = "reliable"
    durability: str = "volatile"


class Topic(Enum):
    """A topic of the node: its name below the node's own, its message and its quality of service."""

    SHAPES = "objects/shapes", _OBJECTS, Quality(100, durability=LATCHED)
    """A monitor that starts after the publisher still receives every shape."""

    STATES = "objects/states", _OBJECT_STATES, Quality(10, "best_effort")
    """Sensor data: a newer state makes an old one worthless. The depth covers one slow step at 1 kHz."""

    TRAJECTORIES = "objects/trajectories", _PLANS, Quality(100, durability=LATCHED)
    """Plans of objects. A monitor that starts after the planner still receives them."""

    SETTINGS = "settings", "rcl_interfaces/msg/ParameterEvent", Quality(1000)
    """Only recorded; live, ROS has /parameter_events."""

    CONTACTS = "contacts", "collision_monitor_msgs/msg/ContactArray", Quality(10)
    PREDICTIONS = "predictions", "collision_monitor_msgs/msg/PredictedCollisionArray", Quality(10)
    """Contacts and predictions are reliable: a subscriber that keeps up loses none."""

    ALERTS = "alerts", "collision_monitor_msgs/msg/CollisionAlert", Quality(1000)
    """One message for each change. Reliable; the depth covers a step in which many alerts change at once."""

    RAISED_ALERTS = "raised_alerts", "collision_monitor_msgs/msg/CollisionAlertArray", Quality(1, durability=LATCHED)
    """All that are raised, for a subscriber that starts late. Not recorded, because the changes are."""

    STATUS = "status", "collision_monitor_msgs/msg/MonitorStatus", Quality(1, durability=LATCHED)
    """A new subscriber gets the last status at once."""

    MONITORED_SHAPES = "monitored/shapes", _OBJECTS, Quality(100, durability=LATCHED)
    MONITORED_STATES = "monitored/states", _OBJECT_STATES, Quality(10, "best_effort")
    MONITORED_PLANS = "monitored/trajectories", _PLANS, Quality(100)
    """What the node takes from its own topics and its sources, for viewers. Not recorded, because the inputs are."""

    SOURCES = "sources", "diagnostic_msgs/msg/DiagnosticArray", Quality(1)
    """About the other programs' topics that the node reads, about once a second. Recorded is what is not monitored, at
    each change."""

    MARKERS = "markers", "visualization_msgs/msg/MarkerArray", Quality(1)
    """A picture for people, who need only the newest."""

    def __init__(self, path: str, type_name: str, quality: Quality) -> None:
        self.path = path
        self.type_name = type_name
        self.quality = quality

    @property
    def message(self) -> str:
        """Name of the message without its package: `ContactArray`."""
        return self.type_name.rpartition("/")[2]

    @property
    def private(self) -> str:
        """Name relative to the node: `~/contacts`."""
        return f"~/{self.path}"

    def of(self, node: str = NODE) -> str:
        """Return the full name: `/object_monitor/contacts`."""
        return f"/{node}/{self.path}"


RECORDED: Final = (
    *(Topic.SHAPES, Topic.STATES, Topic.SETTINGS, Topic.CONTACTS, Topic.PREDICTIONS, Topic.STATUS, Topic.ALERTS),
    *(Topic.SOURCES, Topic.TRAJECTORIES),
)
"""The topics that the node records, in the order of a session's channels."""
