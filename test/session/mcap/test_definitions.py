"""The definitions in a session against other readers and against the installed type descriptions."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from collision_monitor.errors import SessionError
from collision_monitor.session.mcap import definitions
from collision_monitor.session.mcap.rosbag2 import RECORDED_TYPES, full_name


@pytest.mark.parametrize("name", RECORDED_TYPES)
def test_rosbags_parses_every_definition(name: str) -> None:
    from rosbags.typesys import get_types_from_msg

    types = get_types_from_msg(definitions.definition(full_name(name)), full_name(name))
    assert full_name(name) in types
    assert "builtin_interfaces/msg/Time" in types


@pytest.mark.parametrize("name", RECORDED_TYPES)
def test_mcap_ros2_makes_a_decoder_of_every_definition(name: str) -> None:
    from mcap_ros2._dynamic import generate_dynamic

    decoders = generate_dynamic(full_name(name), definitions.definition(full_name(name)))
    assert full_name(name) in decoders


def test_every_nested_type_comes_once() -> None:
    text = definitions.definition("collision_monitor_msgs/msg/ObjectDescriptionArray")
    nested = [line[5:] for line in text.splitlines() if line.startswith("MSG: ")]
    assert sorted(nested) == sorted(set(nested))
    assert set(nested) == {
        "std_msgs/Header",
        "builtin_interfaces/Time",
        "collision_monitor_msgs/ObjectDescription",
        "collision_monitor_msgs/Shape",
        "geometry_msgs/Pose",
        "geometry_msgs/Point",
        "geometry_msgs/Quaternion",
    }


@pytest.mark.parametrize("name", RECORDED_TYPES)
def test_the_hash_is_that_of_the_installed_type(name: str) -> None:
    path = Path(sys.prefix) / "share" / f"{full_name(name)}.json"
    if not path.is_file():
        pytest.skip(f"{full_name(name)} is not installed in this environment")
    hashes = {each["type_name"]: each["hash_string"] for each in json.loads(path.read_text())["type_hashes"]}
    assert definitions.type_hash(full_name(name)) == hashes[full_name(name)]
    assert definitions.type_hash(full_name(name)).startswith("RIHS01_")


def test_a_machine_without_ros_has_the_same_definitions(monkeypatch: pytest.MonkeyPatch) -> None:
    """`python test/session/mcap/test_definitions.py` writes the copy in the package."""
    with_ros = {name: definitions.definition(full_name(name)) for name in RECORDED_TYPES}
    monkeypatch.setattr(definitions, "_roots", lambda: iter(()))
    assert {name: definitions.definition(full_name(name)) for name in RECORDED_TYPES} == with_ros


def test_an_unknown_type_is_named() -> None:
    with pytest.raises(SessionError, match="expected nowhere_msgs/msg/Nothing"):
        definitions.definition("nowhere_msgs/msg/Nothing")
    assert definitions.type_hash("nowhere_msgs/msg/Nothing") == ""


if __name__ == "__main__":
    texts = [
        f"MSG: {full_name(each).replace('/msg/', '/')}\n{definitions.definition(full_name(each))}"
        for each in RECORDED_TYPES
    ]
    titles = {line.removeprefix("MSG: ") for text in texts for line in text.splitlines() if line.startswith("MSG: ")}
    sections = [
        f"{'=' * 80}\nMSG: {title}\n{definitions._read(title.replace('/', '/msg/'), 'msg')}\n"
        for title in sorted(titles)
    ]
    Path(definitions.__file__).with_name("definitions.txt").write_text("".join(sections))
