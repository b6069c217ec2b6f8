"""PLY, as text and binary of both orders of bytes: all that its head states is there, and nothing behind it."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_files import CUBE, CUBE_QUADS, soup, volume

from collision_monitor.errors import ShapeError
from collision_monitor.shapes.mesh_formats.ply import read_ply

POINTS, FACES = soup(4)
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


def ply(
    form: str,
    vertices: np.ndarray,
    rings: list[list[int]],
    *,
    vertex: tuple[tuple[str, str], ...] = (("double", "x"), ("double", "y"), ("double", "z")),
    face: str = "property list uchar int vertex_indices",
    more: str = "",
    name: str = "face",
) -> bytes:
    """A file with the numbers of each vertex as they are, and a flag behind each face if `face` has a second line."""
    properties = "".join(f"property {kind} {each}\n" for kind, each in vertex)
    head = f"ply\nformat {form} 1.0\ncomment {more}\nelement vertex {len(vertices)}\n{properties}"
    head += f"element {name} {len(rings)}\n{face}\nend_header\n"
    flag = [7] if "flag" in face else []
    if form == "ascii":
        rows = [" ".join(map(repr, row)) for row in vertices.tolist()]
        rows += [" ".join(map(str, [len(ring), *ring, *flag])) for ring in rings]
        return (head + "\n".join(rows) + "\n").encode()
    order = ORDERS[form]
    kinds = {"double": "f8", "float": "f4", "uchar": "u1", "int": "i4", "uint": "u4", "ushort": "u2"}
    length, index = face.split()[2:4]
    body = b"".join(
        np.array(row[k], order + kinds[kind]).tobytes() for row in vertices for k, (kind, _) in enumerate(vertex)
    )
    for ring in rings:
        body += np.array(len(ring), order + kinds[length]).tobytes() + np.array(ring, order + kinds[index]).tobytes()
        body += np.array(flag, "u1").tobytes()
    return head.encode() + body


@pytest.mark.parametrize("form", ORDERS)
def test_triangles(form: str) -> None:
    mesh = read_ply(ply(form, POINTS, FACES.tolist()))
    np.testing.assert_array_equal(mesh.vertices, POINTS)
    np.testing.assert_array_equal(mesh.faces, FACES)


@pytest.mark.parametrize("form", ORDERS)
@pytest.mark.parametrize("name", ["vertex_indices", "vertex_index"])
def test_polygons_of_different_sizes_between_other_properties(form: str, name: str) -> None:
    vertices = np.concatenate([np.zeros((8, 1)), CUBE[:, ::-1], np.full((8, 1), 9.0)], axis=1)
    kinds = (("uchar", "flag"), ("float", "z"), ("float", "y"), ("float", "x"), ("float", "quality"))
    rings = [
        *CUBE_QUADS[:4],
        *([ring[k] for k in corners] for ring in CUBE_QUADS[4:] for corners in ([0, 1, 2], [0, 2, 3])),
    ]
    face = f"property list ushort uint {name}\nproperty uchar flag"
    mesh = read_ply(ply(form, vertices, rings, vertex=kinds, face=face))
    np.testing.assert_array_equal(mesh.vertices, CUBE)
    assert len(mesh.faces) == 12 and volume(mesh.vertices, mesh.faces) == pytest.approx(1.0)


@pytest.mark.parametrize("form", ORDERS)
def test_strips(form: str) -> None:
    """Each second triangle of a strip is turned; -1 begins another strip."""
    strip = [0, 1, 2, 3, 4, -1, 5, 6, 7, -1, 8]
    mesh = read_ply(ply(form, POINTS, [strip, [9, 10, 11]], name="tristrips"))
    assert mesh.faces.tolist() == [[0, 1, 2], [3, 2, 1], [2, 3, 4], [5, 6, 7], [9, 10, 11]]


@pytest.mark.parametrize("form", ORDERS)
def test_a_file_that_is_cut_anywhere_is_refused(form: str) -> None:
    data = ply(form, POINTS[:9], [[0, 1, 2], [3, 4, 5, 6], [0, 7, 8]])
    assert len(read_ply(data).faces) == 4
    for end in range(len(data) - 2):  # the last line break, and in a text the last digit, may go
        with pytest.raises(ShapeError):
            read_ply(data[:end])
    for behind in (b"0", b"\0"):
        with pytest.raises(ShapeError, match=r"got 1 (bytes|words) behind them"):
            read_ply(data + behind)


TEXT = ply("ascii", POINTS[:4], [[0, 1, 2]]).decode()
BROKEN = {
    "no head": ("solid", "expected a head from `ply` to `end_header`"),
    "format": (TEXT.replace("ascii 1.0", "ascii 2.0"), "line 2: expected format, element or property"),
    "no format": (TEXT.replace("format ascii 1.0\n", ""), "expected a line `format`"),
    "type": (TEXT.replace("double y", "complex y"), "line 6: expected format, element or property"),
    "property of nothing": (TEXT.replace("element vertex 4\n", ""), "line 4: expected format"),
    "length": (TEXT.replace("list uchar", "list float"), "expected a whole number as length of a list"),
    "count": (TEXT.replace("vertex 4", "vertex -4"), "expected format, element or property"),
    "many": (TEXT.replace("face 1", f"face {10**15}"), "expected 1000000000000000 of the element face, got 1"),
    "no z": (TEXT.replace("double z", "double w"), "expected vertices with x, y and z, got none with z"),
    "number": (TEXT.replace("\n3 0 1 2", "\n3 0 1 x"), "expected numbers as the values of face"),
    "list": (TEXT.replace("\n3 0 1 2", "\n-3 0 1 2"), "face 0: expected the length of a list, got b'-3'"),
    "range": (TEXT.replace("\n3 0 1 2", "\n3 0 1 4"), "expected corners from 0 to 3, got 0.0 to 4.0"),
    "fraction": (TEXT.replace("\n3 0 1 2", "\n3 0 1 1.5"), "expected corners from 0 to 3"),
    "a number of Python": (TEXT.replace("\n3 0 1 2", "\n3 0 1 0_2"), "expected numbers as the values of face"),
    "a corner below 0": (TEXT.replace("\n3 0 1 2", "\n3 0 1 -1"), "expected corners from 0 to 3, got -1.0"),
    "two corners": (TEXT.replace("\n3 0 1 2", "\n2 0 1"), "at least 3 corners, got one of 2"),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_damage_is_named(kind: str) -> None:
    text, reason = BROKEN[kind]
    with pytest.raises(ShapeError) as caught:
        read_ply(text.encode())
    assert reason in str(caught.value)


def test_points_alone_have_no_faces() -> None:
    head, _, body = TEXT.partition("element face 1\n")
    body = "end_header\n" + "\n".join(body.splitlines()[2:6]) + "\n"
    assert read_ply((head + body).encode()).faces.shape == (0, 3)


@pytest.mark.parametrize("form", list(ORDERS)[1:])
def test_a_first_list_that_lies_takes_no_memory(form: str) -> None:
    """The length of the first list says two thousand million; the file has 40 bytes for it."""
    head = ply(form, POINTS[:4], [[0, 1, 2]], face="property list uint int vertex_indices")
    order = ORDERS[form]
    data = head[: -4 * 4] + np.array([2_000_000_000, 0, 1, 2], order + "u4").tobytes()
    with pytest.raises(ShapeError, match="cut off"):
        read_ply(data)
