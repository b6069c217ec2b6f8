"""The packages of interfaces/ have the published fields, and none is built that a sourced install has."""

from __future__ import annotations

from pathlib import Path

import machine
import pytest
from ros_messages import definitions
from rosbags.typesys import Stores, get_typestore

import interfaces

PUBLISHED = {
    "tf2_msgs/msg/TFMessage": "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    "vision_msgs/msg/Detection3DArray": "RIHS01_793f5eab9595ac1c0da07873cc859db42eae51f0ee76056db8562515d830e018",
}
"""Type hashes of the packages in ROS 2 Jazzy."""


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_type_hashes_are_the_published_ones(name: str) -> None:
    store = get_typestore(Stores.EMPTY)
    store.register({**get_typestore(Stores.ROS2_JAZZY).fielddefs, **definitions()})
    assert store.hash_rihs01(name) == PUBLISHED[name]


def test_a_package_of_a_sourced_install_is_never_shadowed(tmp_path: Path) -> None:
    (tmp_path / "share" / "tf2_msgs").mkdir(parents=True)
    ros = machine.RosInstall("jazzy", (tmp_path,), (3, 12))
    assert set(interfaces.missing(None)) - set(interfaces.missing(ros)) == {"tf2_msgs"}
    assert interfaces.inputs(None) != interfaces.inputs(ros)


def test_packages_name_what_their_messages_use(tmp_path: Path) -> None:
    assert interfaces.depends("vision_msgs") == ["geometry_msgs", "std_msgs"]
    assert interfaces.depends("tf2_msgs") == ["geometry_msgs"]
    interfaces.write_package("moveit_msgs", tmp_path / "moveit_msgs")
    cmake = (tmp_path / "moveit_msgs" / "CMakeLists.txt").read_text()
    assert "msg/PlanningScene.msg" in cmake
    for other in ("octomap_msgs", "object_recognition_msgs", "shape_msgs", "trajectory_msgs"):
        assert f"find_package({other} REQUIRED)" in cmake
        assert f"<depend>{other}</depend>" in (tmp_path / "moveit_msgs" / "package.xml").read_text()
