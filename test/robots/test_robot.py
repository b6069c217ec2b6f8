"""A robot from its files: shapes of the links, meshes, files that are missing, pairs that touch by construction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from collision_monitor import Box, Capsule, Cylinder, Mesh, Sphere
from collision_monitor.errors import InputError
from collision_monitor.robots.robot import Description, Robot

ARM = Path(__file__).parents[2] / "examples/arm"
MODELS = Path(__file__).parent / "models"
TETRAHEDRON = """v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
f 1 3 2
f 1 2 4
f 2 3 4
f 1 4 3
"""


def robot_of(collisions: str, folder: Path = Path()) -> Robot:
    text = f'<robot name="r">\n<link name="a">{collisions}</link>\n</robot>'
    return Robot(Description(text, "r.urdf", folder))


def geometry(text: str) -> str:
    return f"<collision><geometry>{text}</geometry></collision>"


def volume(mesh: Mesh) -> float:
    """Signed volume (m³): positive if the faces are counter-clockwise from outside."""
    return float(np.linalg.det(mesh.vertices[mesh.faces]).sum() / 6)


def test_geometries_become_shapes() -> None:
    texts = ('<box size="1 2 3"/>', '<sphere radius="1"/>', '<cylinder radius="1" length="2"/>')
    robot = robot_of("".join(map(geometry, (*texts, '<capsule radius="1" length="2"/>'))))
    assert [shape for shape, _ in robot.shapes[0]] == [Box((1, 2, 3)), Sphere(1), Cylinder(1, 2), Capsule(1, 2)]
    assert not robot.problems


@pytest.mark.parametrize(("scale", "factor"), [("1 1 1", 1), (".001 .001 .001", 1e-9), ("-1 1 2", 2), ("-1 -1 1", 1)])
def test_a_mesh_is_scaled_and_its_faces_point_outwards(tmp_path: Path, scale: str, factor: float) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "part.obj").write_text(TETRAHEDRON)
    robot = robot_of(geometry(f'<mesh filename="meshes/part.obj" scale="{scale}"/>'), tmp_path)
    ((mesh, _),) = robot.shapes[0]
    assert isinstance(mesh, Mesh)
    assert volume(mesh) == pytest.approx(factor / 6)


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "dae", "glb"])
def test_mesh_files_of_every_kind(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"part.{suffix}"
    trimesh.creation.box((1, 2, 3)).export(path)
    ((mesh, _),) = robot_of(geometry(f'<mesh filename="{path.name}"/>'), tmp_path).shapes[0]
    assert isinstance(mesh, Mesh)
    assert volume(mesh) == pytest.approx(6) and len(mesh.vertices) == 8  # welded, also where the file repeats corners


def test_the_unit_of_collada_counts(tmp_path: Path) -> None:
    path = tmp_path / "part.dae"
    text = trimesh.creation.box((1, 2, 3)).export(file_type="dae").decode()
    path.write_text(text.replace("<up_axis>", '<unit name="centimeter" meter="0.01"/><up_axis>'))
    ((mesh, _),) = robot_of(geometry('<mesh filename="part.dae"/>'), tmp_path).shapes[0]
    assert isinstance(mesh, Mesh)
    assert volume(mesh) == pytest.approx(6e-6)


def test_addresses_of_meshes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for folder in ("ours/meshes", "prefix/share/installed", "old/source", "robots/above"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "part.obj").write_text(TETRAHEDRON)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "prefix"))
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "old"))
    addresses = (
        f"file://{tmp_path}/ours/meshes/part.obj",
        f"file://localhost{tmp_path}/ours/meshes/part.obj",
        "package://given/meshes/part.obj",
        "package://installed/part.obj",
        "model://source/part.obj",
        "package://above/part.obj",
    )
    text = "".join(geometry(f'<mesh filename="{address}"/>') for address in addresses)
    (tmp_path / "robots/above/urdf").mkdir()
    description = Description(f'<robot><link name="a">{text}</link></robot>', "r.urdf", tmp_path / "robots/above/urdf")
    robot = Robot(description, packages={"given": tmp_path / "ours"})
    assert len(robot.shapes[0]) == len(addresses) and not robot.problems


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ('<mesh filename="package://nowhere/part.stl"/>', "in the package 'nowhere', got none (searched: no folder)"),
        ('<mesh filename="part.stl"/>', "part.stl', got nothing there"),
        ('<mesh filename="https://example.com/part.stl"/>', "expected a path, file:// or package://, got 'https:"),
        ('<mesh filename="file://server/part.stl"/>', "expected file:///PATH, a file of this machine, got 'file://server/"),
        ('<mesh filename="r.stl"/>', "r.stl: expected a mesh in STL format: expected the 84 bytes of a head"),
        ("<mesh/>", "expected an attribute filename, got no attribute"),
        ('<mesh filename="part.obj" scale="1 0 1"/>', "expected a scale without zeros, got [1.0, 0.0, 1.0]"),
        ('<box size="1 -2 3"/>', "Box size: expected 3 extents"),
        ('<sphere radius="0"/>', "Sphere radius: expected a positive number"),
        ('<sphere radius="inf"/>', "radius: expected a finite number, got 'inf'"),
        ("<cone/>", "expected <box>, <sphere>, <cylinder>, <capsule> or <mesh>, got <cone>"),
    ],
)
def test_a_geometry_that_cannot_be_used_is_named_and_the_others_stay(tmp_path: Path, text: str, reason: str) -> None:
    (tmp_path / "part.obj").write_text(TETRAHEDRON)
    (tmp_path / "r.stl").write_text("no mesh")
    robot = robot_of(geometry('<sphere radius="1"/>') + "\n" + geometry(text), tmp_path)
    assert [shape for shape, _ in robot.shapes[0]] == [Sphere(1)]
    (problem,) = robot.problems
    assert problem.startswith("r.urdf, line 3, link a: ") and reason in problem and "\n" not in problem
    with pytest.raises(InputError, match=r"r.urdf: expected a link with a <collision> that can be used, got none: r"):
        robot_of(geometry(text), tmp_path)


def test_a_file_that_is_missing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"arm.urdf: expected a file that can be read, got nothing there"):
        Description.read(tmp_path / "arm.urdf")


def test_srdf_and_construction_allow_pairs() -> None:
    srdf = Description.read(ARM / "arm.srdf")
    arm = Robot(Description.read(ARM / "arm.urdf"), srdf)
    assert arm.disabled == {("left_finger", "right_finger"), ("wrist_1", "wrist_3")} and not arm.problems
    assert ("hand", "wrist_3") in arm.touching  # rigid, over a flange without a shape
    assert ("hand", "wrist_2") not in arm.touching
    other = Description('<robot><disable_collisions link1="tail" link2="hand"/></robot>', "other.srdf")
    (problem,) = Robot(Description.read(ARM / "arm.urdf"), other).problems
    assert problem.startswith("other.srdf: expected links of ") and problem.endswith("got tail")


def test_links_without_shapes_pass_contact_on() -> None:
    base = Robot(Description.read(MODELS / "mobile_base.urdf"))
    assert ("back_caster", "base_link") in base.touching  # over a fork without a shape
    assert ("mast", "torso") in base.touching and ("laser", "mast") in base.touching
    for pair in (("back_caster", "front_caster"), ("base_link", "torso"), ("left_wheel", "right_wheel")):
        assert pair not in base.touching


def test_needs_are_the_joints_on_the_way_to_the_base() -> None:
    arm = Robot(Description.read(ARM / "arm.urdf"))
    needs = dict(zip(arm.tree.links, arm.tree.needs.sum(axis=1), strict=True))
    assert needs["base"] == 0 and needs["forearm"] == 4 and needs["hand"] == 7 and needs["right_finger"] == 8
