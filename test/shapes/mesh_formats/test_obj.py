"""OBJ: numbers of vertices from the front and from the line, polygons, and lines that are none."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_files import CUBE, CUBE_QUADS, soup, volume, write

import collision_monitor as cm
from collision_monitor.errors import ShapeError
from collision_monitor.shapes.mesh_formats.obj import read_obj

POINTS, FACES = soup(2)


def cube_lines(centre: tuple[float, float, float]) -> list[str]:
    """A unit cube whose faces count its vertices from their own line back."""
    vertices = [f"v {x} {y} {z}" for x, y, z in (CUBE + centre).tolist()]
    return vertices + ["f " + " ".join(str(k - 8) for k in quad) for quad in CUBE_QUADS]


def test_numbers_relative_to_the_line_mean_the_vertices_before_it(tmp_path) -> None:
    """Each cube follows its vertices. A reader that counts from the end of the file puts both at the second one."""
    text = "\n".join(cube_lines((0, 0, 0)) + cube_lines((3, 0, 0)))
    mesh = cm.load_mesh(write(tmp_path, "two.obj", text))
    assert mesh.surface.closed and mesh.surface.volume == pytest.approx(2.0)
    gap = cm.contact(mesh, cm.Pose(), cm.Sphere(0.1), cm.Pose((-1, 0, 0))).signed_distance
    assert gap == pytest.approx(0.4)


def test_every_way_to_write_a_corner() -> None:
    rng = np.random.default_rng(3)
    lines = [f"v {x!r} {y!r} {z!r}" + (" 1.0" if rng.random() < 0.5 else " 0.5 0.5 0.5") for x, y, z in POINTS.tolist()]
    for k, face in enumerate(FACES):
        words = []
        for corner in face:
            number = corner + 1 if rng.random() < 0.5 else corner - len(POINTS)
            words.append(f"{number}" + ("", "/1", "//1", "/-1/7")[rng.integers(4)])
        lines.append(("f " if k % 2 else "f\t") + " ".join(words) + ("  # a face" if k % 3 == 0 else ""))
    lines[50] = lines[50].replace(" ", " \\\n ", 2)  # goes on in the next line
    extra = ["# comment", "mtllib a.mtl", "o part", "g", "s off", "usemtl x", "vn 0 0 1", "vt 0 0", "l 1 2", "p 1", ""]
    for end in ("\n", "\r\n", "\r"):
        mesh = read_obj(end.join(extra + lines).encode())
        np.testing.assert_array_equal(mesh.vertices, POINTS)
        np.testing.assert_array_equal(mesh.faces, FACES)


def test_a_mark_of_the_encoding_is_no_word() -> None:
    assert len(read_obj(b"\xef\xbb\xbfv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").faces) == 1


def test_polygons_keep_their_area_and_close() -> None:
    lines = [f"v {x} {y} {z}" for x, y, z in CUBE.tolist()]
    lines += ["f " + " ".join(str(k + 1) for k in quad) for quad in CUBE_QUADS]
    mesh = read_obj("\n".join(lines).encode())
    assert len(mesh.faces) == 12 and volume(mesh.vertices, mesh.faces) == pytest.approx(1.0)


BROKEN = {
    "v 0 0": "line 1: expected three coordinates of a vertex, got 2",
    "v 0 0 x": "line 1: expected three coordinates of a vertex, got 'x'",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2": "line 4: expected a face of at least 3 corners, got 2",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4": "line 4: expected the number of one of 3 vertices, 3 of them before",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0": "got 0",
    "v 0 0 0\nf -1 -2 -3\nv 1 0 0\nv 0 1 0": "line 2: expected the number of one of 3 vertices, 1 of them before",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 x/1": "line 5: expected numbers of vertices as corners of a face, got 'x'",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999": "more than 64 bits",
    "v 0 0 0\nw 1 0 0": "line 2: expected vertices (v) and faces (f), got 'w', which is not read",
    "surf 0 1 0 1 1 2 3": "got 'surf', which is not read",
    "v 1_0 0 0": "line 1: expected three coordinates of a vertex, got '1_0'",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0_3": "line 4: expected numbers of vertices as corners of a face, got '0_3'",
    "call other.obj": "got 'call'",
    "\x89PNG": "which is not read",
}


@pytest.mark.parametrize("text", BROKEN)
def test_a_line_that_cannot_be_read_is_named(text: str) -> None:
    with pytest.raises(ShapeError) as caught:
        read_obj(text.encode())
    assert BROKEN[text] in str(caught.value)
