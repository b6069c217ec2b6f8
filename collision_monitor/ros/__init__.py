"""Everything that needs rclpy: the monitor node, the world node that plays scenes, their parameters and markers."""
