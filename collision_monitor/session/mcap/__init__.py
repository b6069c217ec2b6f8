"""MCAP files as rosbag2 writes them: reading, writing, salvaging."""
