"""Robots: URDF and SRDF files, the shapes of the links, forward kinematics with velocities. Does not need ROS."""
