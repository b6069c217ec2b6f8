"""`load_mesh`: formats, units, scenes of several parts, welding, and files that are none."""

from __future__ import annotations

import struct

import numpy as np
import pytest
import trimesh

import collision_monitor as cm
from collision_monitor.errors import ShapeError
from collision_monitor.shapes.mesh_file import WELD

TORUS = trimesh.creation.torus(1.0, 0.25, major_sections=12, minor_sections=8)
QUARTER = trimesh.transformations.rotation_matrix(np.pi / 2, (0, 0, 1), (0, 0, 0))
QUARTER[:3, 3] = (3, 0, 0)


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "obj", "ply", "dae", "glb"])
def test_every_format_gives_the_closed_surface(tmp_path, kind):
    path = tmp_path / f"ring.{kind.removesuffix('_ascii').upper()}"
    path.write_bytes(data if isinstance(data := TORUS.export(file_type=kind), bytes) else data.encode())
    mesh = cm.load_mesh(path, scale=2.0)
    assert mesh.surface.closed and mesh.surface.oriented
    assert mesh.surface.volume == pytest.approx(8 * TORUS.volume, rel=1e-5)
    inside = cm.contact(mesh, cm.Pose(), cm.Sphere(0.05), cm.Pose((2, 0, 0)))
    assert inside.overlaps


def test_the_parts_of_a_scene_are_one_mesh_in_its_frame(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box((1, 2, 3)), node_name="a")
    scene.add_geometry(trimesh.creation.box((1, 2, 3)), node_name="b", transform=QUARTER)
    (tmp_path / "two.glb").write_bytes(scene.export(file_type="glb"))
    mesh = cm.load_mesh(tmp_path / "two.glb")
    assert mesh.surface.closed and mesh.surface.volume == pytest.approx(12.0)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), (4, 1, 1.5), atol=1e-6)


def test_the_unit_that_a_file_states_applies(tmp_path):
    text = trimesh.creation.box((1000, 2000, 3000)).export(file_type="dae").decode()
    unit = '<unit name="millimeter" meter="0.001"/>'
    (tmp_path / "box.dae").write_text(text.replace("</modified>", f"</modified>{unit}"))
    assert cm.load_mesh(tmp_path / "box.dae").surface.volume == pytest.approx(6.0)


def test_cracks_are_welded_within_the_tolerance_only(tmp_path):
    rng = np.random.default_rng(0)
    for part, closed in ((0.1, True), (30.0, False)):
        corners = TORUS.triangles.reshape(-1, 3)
        noise = rng.uniform(-1, 1, corners.shape) * WELD * part
        trimesh.Trimesh(corners + noise, np.arange(len(corners)).reshape(-1, 3), process=False).export(
            tmp_path / "cracks.ply", encoding="ascii", vertex_normal=False
        )
        lines = (tmp_path / "cracks.ply").read_text().splitlines()
        end = lines.index("end_header") + 1
        rows = [" ".join(map(repr, row.tolist())) for row in corners + noise]
        lines[end : end + len(rows)] = rows
        header = [line.replace("float x", "double x").replace("float y", "double y").replace("float z", "double z")
                  for line in lines]  # fmt: skip
        (tmp_path / "cracks.ply").write_text("\n".join(header) + "\n")
        mesh = cm.load_mesh(tmp_path / "cracks.ply")
        assert mesh.surface.closed == closed
        assert np.abs(mesh.vertices - corners).max() < 4 * WELD * 2.5 + WELD * part


def test_a_doubtful_size_raises_a_warning(tmp_path):
    trimesh.creation.box((2000, 1, 1)).export(tmp_path / "long.stl")
    with pytest.warns(UserWarning, match=r"2000 m large; if the file is in millimetres, use scale=0\.001"):
        cm.load_mesh(tmp_path / "long.stl")
    assert cm.load_mesh(tmp_path / "long.stl", scale=0.001).surface.closed


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), float("inf"), "mm", None])
def test_impossible_scales_are_refused(tmp_path, scale):
    TORUS.export(tmp_path / "ring.stl")
    with pytest.raises(ShapeError, match="scale"):
        cm.load_mesh(tmp_path / "ring.stl", scale=scale)


def test_files_that_are_none_are_refused(tmp_path):
    ring = TORUS.export(file_type="stl")
    broken = {
        "empty.stl": b"",
        "text.stl": b"solid of nothing\nendsolid",
        "cut.stl": ring[: len(ring) // 2],
        "greedy.stl": ring[:80] + struct.pack("<I", 4_000_000_000) + ring[84:],
        "noise.glb": bytes(range(256)) * 20,
        "cut.glb": TORUS.export(file_type="glb")[:300],
        "noise.ply": b"ply\nformat ascii 1.0\nelement vertex 3\n",
        "points.ply": trimesh.PointCloud(np.eye(3)).export(file_type="ply"),
        "noise.dae": b"<COLLADA>",
        "empty.obj": b"# nothing\n",
        "wrong.obj": b"v 0 0 0\nv 1 0 0\nf 1 2 9\n",
        "nan.obj": b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "archive.zip": b"PK",
        "none": b"",
    }
    for name, content in broken.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ShapeError, match=name):
            cm.load_mesh(tmp_path / name)
    (tmp_path / "folder.stl").mkdir()
    for missing in ("folder.stl", "missing.stl"):
        with pytest.raises(ShapeError, match=missing):
            cm.load_mesh(tmp_path / missing)


def test_a_crowd_of_vertices_in_a_point_is_welded(tmp_path):
    """Many different vertices within the tolerance have no quadratic number of pairs."""
    rng = np.random.default_rng(0)
    corners = np.concatenate([rng.normal(size=(30_000, 3)) * 1e-9, np.eye(3)])
    trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False).export(tmp_path / "crowd.glb")
    mesh = cm.load_mesh(tmp_path / "crowd.glb")
    assert len(mesh.surface.faces) <= 10
