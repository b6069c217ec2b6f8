"""Conversion of other programs' messages, live and from bags, to inputs of the monitor. Does not need ROS."""

from collision_monitor.sources.decoding import Decoder
from collision_monitor.sources.feed import Feed, Input
from collision_monitor.sources.importing import Imported, import_bag
from collision_monitor.sources.mapping import Mapping, load_mapping
from collision_monitor.sources.source import RawMessage

__all__ = ["Decoder", "Feed", "Imported", "Input", "Mapping", "RawMessage", "import_bag", "load_mapping"]
