"""Conversion of other programs' messages, live and from bags, to inputs of the monitor. Does not need ROS.

What reads bags is imported at its first use, so that a node does without the packages for MCAP.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from collision_monitor.sources.decoding import Decoder
from collision_monitor.sources.feed import Feed, Input
from collision_monitor.sources.ground.mapping import Mapping, load_mapping
from collision_monitor.sources.ground.source import RawMessage
from collision_monitor.sources.ground.unmonitored import Unmonitored, UnmonitoredRecord, as_status

if TYPE_CHECKING:
    from collision_monitor.sources.importing import Imported, import_bag

__all__ = [
    "Decoder",
    "Feed",
    "Imported",
    "Input",
    "Mapping",
    "RawMessage",
    "Unmonitored",
    "UnmonitoredRecord",
    "as_status",
    "import_bag",
    "load_mapping",
]


def __getattr__(name: str) -> Any:
    """Import what reads bags at its first use."""
    if name not in ("Imported", "import_bag"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from collision_monitor.sources import importing

    return getattr(importing, name)
