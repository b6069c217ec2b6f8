"""Alerts: rules about pairs of objects, evaluated after each step from its answers and the states, without ROS."""
