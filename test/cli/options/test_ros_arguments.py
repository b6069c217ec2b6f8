"""ROS reads options back with the value and type that were given."""

from pathlib import Path

import pytest
import rclpy

from collision_monitor.cli.options.ros_arguments import parameters


@pytest.mark.parametrize(
    "value", ["fleet", "7", "yes", "1e5", "null", "a b", "über", 'say "so"', "it's", "~", 3, 0.5, 1e-05, 1e20]
)
def test_ros_reads_back_what_was_given(ros_domain_id, value):
    context = rclpy.Context()
    rclpy.init(args=["x", "--ros-args", *parameters(it=value, nothing=None)], context=context)
    try:
        node = rclpy.create_node("x", context=context, automatically_declare_parameters_from_overrides=True)
        given = node.get_parameter("it").value
        assert given == value
        assert type(given) is type(value)
        assert not node.has_parameter("nothing")
        node.destroy_node()
    finally:
        rclpy.shutdown(context=context)


def test_a_path_is_a_text():
    assert parameters(record=Path("runs/7.mcap")) == ["-p", 'record:="runs/7.mcap"']
