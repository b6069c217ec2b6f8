"""xacro files: expanded by xacro itself, in a process that is bounded."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from collision_monitor.errors import InputError
from collision_monitor.robots import xacro_file
from collision_monitor.robots.robot import Robot
from collision_monitor.robots.xacro_file import expand_xacro
from collision_monitor.shapes.registry import Box, Mesh

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
ARM = f"""{HEAD}
  <xacro:arg name="prefix" default=""/>
  <xacro:arg name="wide" default="1"/>
  <xacro:macro name="beam" params="name"><link name="$(arg prefix)${{name}}"><collision><geometry>
    <box size="$(arg wide) ${{2 * 0.5}} 0.1"/></geometry></collision></link></xacro:macro>
  <xacro:beam name="base"/>
  <xacro:beam name="tool"/>
  <joint name="j" type="fixed"><parent link="$(arg prefix)base"/><child link="$(arg prefix)tool"/></joint>
</robot>"""
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def write(folder: Path, text: str, name: str = "arm.urdf.xacro") -> Path:
    (folder / name).write_text(text)
    return folder / name


def test_a_robot_of_a_xacro_file_with_its_arguments(tmp_path: Path) -> None:
    path = write(tmp_path, ARM)
    assert Robot(path).links == ["base", "tool"]
    left = Robot(path, arguments={"prefix": "left_", "wide": "3"})
    assert left.links == ["left_base", "left_tool"]
    (box, _) = left.shapes[0][0]
    assert isinstance(box, Box) and tuple(box.size) == (3.0, 1.0, 0.1)


def test_packages_are_found_as_installed_ones_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In `$(find NAME)` of xacro, and in package:// of what it makes."""
    pytest.importorskip("ament_index_python")
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    (tmp_path / "parts").mkdir()
    write(tmp_path / "parts", f'{HEAD}<link name="a"><collision><geometry><mesh filename="package://ours/part.obj"/>'
          "</geometry></collision></link></robot>", "part.xacro")  # fmt: skip
    (tmp_path / "parts/part.obj").write_text(TETRAHEDRON)
    path = write(tmp_path, f'{HEAD}<xacro:include filename="$(find ours)/part.xacro"/></robot>')
    ((mesh, _),) = Robot(path, packages={"ours": tmp_path / "parts"}).shapes[0]
    assert isinstance(mesh, Mesh)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (f"{HEAD}<xacro:no_such_macro/></robot>", "no_such_macro"),
        ("no xml", "XML|syntax error"),
        (f'{HEAD}<xacro:property name="x" value="${{1/0}}"/><link name="${{x}}"/></robot>', "."),
        (f'{HEAD}<xacro:arg name="needed"/><link name="$(arg needed)"/></robot>', "."),
    ],
)
def test_what_xacro_cannot_read_is_said_in_one_line(tmp_path: Path, text: str, reason: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(InputError, match=rf"expected a file that xacro can read, got: .*({reason})") as error:
        Robot(path)
    assert "\n" not in str(error.value) and str(path) in str(error.value)


def test_a_file_that_goes_on_for_ever_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xacro_file, "LONGEST", 1.5)
    path = write(tmp_path, f'{HEAD}<link name="${{sum(1 for _ in range(10**12))}}"/></robot>')
    with pytest.raises(InputError, match=r"expected xacro to end within 1\.5 s|expected a file that xacro can read"):
        expand_xacro(path, {}, {})


def test_without_xacro_and_with_wrong_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path, ARM)
    with pytest.raises(InputError, match=r"packages: expected names of packages, got '\.\./x'"):
        expand_xacro(path, {}, {"../x": tmp_path})
    os.mkfifo(tmp_path / "pipe.xacro")
    for name in ("nothing.xacro", "pipe.xacro"):
        with pytest.raises(InputError, match="expected a xacro file, got"):
            Robot(tmp_path / name)
    urdf = write(tmp_path, "<robot/>", "arm.urdf")
    with pytest.raises(InputError, match="expected a xacro file, which takes arguments, got another one"):
        Robot(urdf, arguments={"x": "1"})
    monkeypatch.setattr(xacro_file, "find_spec", lambda name: None)
    monkeypatch.setenv("PATH", "")
    with pytest.raises(InputError, match="got a xacro file, and xacro is not installed; `pip install xacro`"):
        Robot(path)
