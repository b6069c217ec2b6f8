"""Files of bags: MCAP, SQLite and ROS 1, each read in order of time, with an account of what is there."""
