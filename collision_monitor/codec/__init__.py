"""The messages of `collision_monitor_msgs` as CDR bytes and as arrays. Does not need ROS.

The elements of the hot messages have in the bytes exactly the layout of `records`, so decoding returns views of them.
"""

from collision_monitor.codec.alert_coverage import RuleCoverage, UnmonitoredObject
from collision_monitor.codec.alerts import (
    AlertCause,
    AlertLevel,
    CollisionAlert,
    CollisionAlertArray,
    decode_alert,
    decode_alerts,
    encode_alert,
    encode_alerts,
)
from collision_monitor.codec.contacts import ContactArray, decode_contacts, encode_contacts
from collision_monitor.codec.descriptions import (
    Change,
    ObjectDescriptionArray,
    Removal,
    decode_descriptions,
    encode_descriptions,
)
from collision_monitor.codec.diagnostics import (
    DiagnosticArray,
    DiagnosticStatus,
    decode_diagnostics,
    encode_diagnostics,
)
from collision_monitor.codec.parameter_event import ParameterEvent, decode_parameter_event, encode_parameter_event
from collision_monitor.codec.predictions import PredictedCollisionArray, decode_predictions, encode_predictions
from collision_monitor.codec.states import ObjectStateArray, decode_states, encode_states
from collision_monitor.codec.status import MonitorStatus, decode_status, encode_status
from collision_monitor.codec.trajectories import (
    ObjectTrajectory,
    ObjectTrajectoryArray,
    decode_trajectories,
    encode_trajectories,
)

__all__ = [
    "AlertCause",
    "AlertLevel",
    "Change",
    "CollisionAlert",
    "CollisionAlertArray",
    "ContactArray",
    "DiagnosticArray",
    "DiagnosticStatus",
    "MonitorStatus",
    "ObjectDescriptionArray",
    "ObjectStateArray",
    "ObjectTrajectory",
    "ObjectTrajectoryArray",
    "ParameterEvent",
    "PredictedCollisionArray",
    "Removal",
    "RuleCoverage",
    "UnmonitoredObject",
    "decode_alert",
    "decode_alerts",
    "decode_contacts",
    "decode_descriptions",
    "decode_diagnostics",
    "decode_parameter_event",
    "decode_predictions",
    "decode_states",
    "decode_status",
    "decode_trajectories",
    "encode_alert",
    "encode_alerts",
    "encode_contacts",
    "encode_descriptions",
    "encode_diagnostics",
    "encode_parameter_event",
    "encode_predictions",
    "encode_states",
    "encode_status",
    "encode_trajectories",
]
