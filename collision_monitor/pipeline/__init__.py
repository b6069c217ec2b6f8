"""Message bytes in, the monitor, message bytes out; without ROS."""
