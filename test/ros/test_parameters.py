"""config/monitor.yaml shows every parameter, with the values that the code has."""

import re
from pathlib import Path

import pytest
import rclpy
import yaml
from rclpy.node import Node

from collision_monitor.profiles import Profile
from collision_monitor.ros.parameters import MonitorParameters, read_monitor_parameters

CONFIG = Path(__file__).parents[2] / "config" / "monitor.yaml"


@pytest.fixture
def read(ros_domain_id):
    """Reads the monitor's parameters as ROS hands them over."""

    def read_parameters(*arguments):
        context = rclpy.Context()
        rclpy.init(args=["x", "--ros-args", *arguments], context=context)
        try:
            node = Node("object_monitor", context=context, automatically_declare_parameters_from_overrides=True)
            return read_monitor_parameters(node), node.describe_parameter
        finally:
            rclpy.shutdown(context=context)

    return read_parameters


def test_the_file_as_it_is_gives_the_defaults(read):
    assert read("--params-file", str(CONFIG))[0] == MonitorParameters(Profile(), "world", "", "single")


def test_the_file_with_every_line_in_force_gives_the_defaults(read, tmp_path):
    text = re.sub(r"^( *)# (\w+: )", r"\1\2", CONFIG.read_text(), flags=re.MULTILINE)
    values = next(iter(yaml.safe_load(text).values()))["ros__parameters"]
    assert set(values) == {"profile", "frame_id", "record", "executor", *(s.name for s in Profile.fields())}
    (tmp_path / "all.yaml").write_text(text)
    assert read("--params-file", str(tmp_path / "all.yaml"))[0].profile == Profile()


def test_a_setting_wins_over_the_profile_it_starts_from(read):
    found, _ = read("-p", "profile:=fast", "-p", "horizon:=7")
    assert found.profile == Profile.named("fast").replace(horizon=7.0)


def test_the_descriptors_say_unit_and_range(read):
    _, describe = read()
    for setting in Profile.fields():
        descriptor = describe(setting.name)
        assert setting.description in descriptor.description
        assert descriptor.read_only
        (limits,) = (*descriptor.floating_point_range, *descriptor.integer_range)
        assert (limits.from_value, limits.to_value) == (setting.minimum, setting.maximum)
