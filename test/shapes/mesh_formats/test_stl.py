"""STL, binary and as text: what it holds, and what is wrong with what is left of it."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from mesh_files import soup, stl, stl_text

from collision_monitor.errors import ShapeError
from collision_monitor.shapes.mesh_formats.stl import read_stl

POINTS, FACES = soup(1)


@pytest.mark.parametrize("head", [b"head", b"solid part", b"SOLID facet vertex endsolid"])
def test_the_size_tells_a_binary_file_whatever_its_head_says(head: bytes) -> None:
    mesh = read_stl(stl(POINTS, FACES, head))
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], POINTS[FACES])


def test_a_text_may_have_several_solids_any_case_and_any_spaces() -> None:
    text = stl_text(POINTS, FACES[:20], "a name of words, facet too") + stl_text(POINTS, FACES[20:], "")
    ends = text.replace("\n", "\r\n"), text.replace("\n", "\r")
    for variant in (text, text.upper(), *ends, "\ufeff" + text, text.replace("\n   vertex", " \t vertex")):
        mesh = read_stl(variant.encode())
        np.testing.assert_array_equal(mesh.vertices[mesh.faces], POINTS[FACES])
    assert len(read_stl(b"solid of nothing\nendsolid").faces) == 0


BROKEN = {
    "cut": (stl(POINTS, FACES)[:-130], "expected 60 triangles, as its head says, got 57: it is cut off"),
    "cut in the head": (stl(POINTS, FACES)[:50], "expected the 84 bytes of a head"),
    "bytes behind": (stl(POINTS, FACES) + b"\0\0\0", "got 3 bytes behind them"),
    "a count that lies": (
        stl(POINTS, FACES)[:80] + struct.pack("<I", 4_000_000_000) + stl(POINTS, FACES)[84:],
        "expected 4000000000 triangles",
    ),
    "text cut between triangles": (stl_text(POINTS, FACES).partition("endsolid")[0], "as many endsolid as solid"),
    "text cut in a triangle": (stl_text(POINTS, FACES)[:-200] + "\nendsolid", "for each triangle"),
    "a word that is damaged": (stl_text(POINTS, FACES).replace("endloop", "endlo0p", 1), "expected the word endloop"),
    "a number that is damaged": (stl_text(POINTS, FACES).replace("vertex ", "vertex x", 1), "expected numbers"),
    "a number of Python": (stl_text(POINTS, FACES).replace("vertex ", "vertex 1_", 1), "expected numbers"),
    "all in one line": (stl_text(POINTS, FACES).replace("\n", " "), "`solid` and the name alone in a line"),
    "another format": ("v 0 0 0\n" * 100, "it is cut off, or no STL"),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_damage_is_named(kind: str) -> None:
    data, text = BROKEN[kind]
    with pytest.raises(ShapeError) as caught:
        read_stl(data if isinstance(data, bytes) else data.encode())
    assert text in str(caught.value)


@pytest.mark.parametrize("text", [stl(POINTS, FACES[:6]), stl_text(POINTS, FACES[:6]).rstrip().encode()])
def test_a_file_that_is_cut_anywhere_is_never_a_smaller_mesh(text: bytes) -> None:
    for end in range(len(text) - len(b" part")):  # the name behind endsolid may go
        with pytest.raises(ShapeError):
            read_stl(text[:end])
