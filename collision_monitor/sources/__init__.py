"""Conversion of other programs' messages: bags become sessions. Does not need ROS."""

from collision_monitor.sources.importing import Imported, import_bag
from collision_monitor.sources.mapping import Mapping, load_mapping

__all__ = ["Imported", "Mapping", "import_bag", "load_mapping"]
