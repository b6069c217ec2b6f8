"""The path from message bytes through the monitor to message bytes. Does not need ROS."""
