"""config/monitor.yaml shows every parameter with the default of the code."""

import re
from pathlib import Path

import pytest
import rclpy
import yaml
from rclpy.node import Node

from collision_monitor.errors import InputError
from collision_monitor.ros.parameters import MonitorParameters, read_monitor_parameters
from collision_monitor.session import Splitting
from collision_monitor.settings.profile import Profile

CONFIG = Path(__file__).parents[2] / "config" / "monitor.yaml"
EVERY_LINE = re.sub(r"^( *)# (\w+: )", r"\1\2", CONFIG.read_text(), flags=re.MULTILINE)
"""The file with the settings that are commented out."""


@pytest.fixture
def read(ros_domain_id):
    """Return a function that reads the monitor's parameters as ROS passes them."""

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
    values = next(iter(yaml.safe_load(EVERY_LINE).values()))["ros__parameters"]
    recording = {"record", *(f"record_{n}" for n in ("mode", "before", "after", "split_size", "split_duration"))}
    running = {"executor", "keep_up", "autostart", "diagnostic_updater.period", "diagnostic_updater.use_fqn"}
    others = {"profile", "frame_id", "sources", "rules"}
    assert set(values) == {*others, *running, *recording, *(s.name for s in Profile.fields())}
    (tmp_path / "all.yaml").write_text(EVERY_LINE)
    assert read("--params-file", str(tmp_path / "all.yaml"))[0].profile == Profile()


def test_a_setting_wins_over_the_profile_it_starts_from(read):
    found, _ = read("-p", "profile:=fast", "-p", "horizon:=7")
    assert found.profile == Profile.named("fast").replace(horizon=7.0)


def test_the_recording_is_split_as_asked(read):
    found, _ = read("-p", "record_split_size:=1000", "-p", "record_split_duration:=60", "-p", "record_mode:=on_event")
    assert found.splitting == Splitting(1000, 60.0, True)


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ("record_mode:=sometimes", "record_mode: expected always or on_event, got 'sometimes'"),
        ("record_before:=-1.0", "before: expected a finite number, at least 0, got -1.0"),
        ("record_split_size:=big", "record_split_size: expected a whole number, got 'big'"),
    ],
)
def test_a_recording_that_cannot_be_is_named(read, given, text):
    with pytest.raises(InputError) as error:
        read("-p", given)
    assert text in str(error.value)


def test_each_description_is_of_whole_sentences(read):
    _, describe = read()
    for name in next(iter(yaml.safe_load(EVERY_LINE).values()))["ros__parameters"]:
        description = describe(name).description
        assert re.fullmatch(r"[A-Z].*\w\S?\.", description) and len(description.split()) > 4, description


def test_the_descriptors_say_unit_and_range(read):
    _, describe = read()
    assert describe("frame_id").read_only
    for setting in Profile.fields():
        descriptor = describe(setting.name)
        assert setting.description in descriptor.description
        assert not descriptor.read_only
        limits = [(each.from_value, each.to_value) for each in descriptor.floating_point_range]
        limits += [(each.from_value, each.to_value) for each in descriptor.integer_range]
        assert limits == ([(setting.minimum, setting.maximum)] if setting.type in (int, float) else [])
        assert all(word in descriptor.additional_constraints for word in setting.choices)
