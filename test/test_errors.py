"""The texts of errors: one line each, whatever they quote."""

from __future__ import annotations

import pickle

import pytest

from collision_monitor.errors import LONGEST_ERROR, CollisionMonitorError, InputError, SessionError, ShapeError


@pytest.mark.parametrize("kind", [CollisionMonitorError, InputError, ShapeError, SessionError])
@pytest.mark.parametrize(
    ("quoted", "shown"),
    [
        ("größe 物体", "größe 物体"),
        ("a\nb\r\tc", r"a\nb\r\tc"),
        ("\x1b[31m\0\x07", r"\x1b[31m\x00\x07"),
        ("\u202eabc\ud800\udcff", r"\u202eabc\ud800\udcff"),
    ],
)
def test_what_an_error_quotes_is_no_line_of_its_own(kind: type[CollisionMonitorError], quoted: str, shown: str) -> None:
    error = kind(f"expected a name, got {quoted}")
    assert str(error) == f"expected a name, got {shown}" == f"{error}"
    str(error).encode()
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_an_error_is_not_longer_than_a_page() -> None:
    text = str(SessionError(f"begin{'x' * 1_000_000}end"))
    assert text.startswith("begin") and text.endswith("end") and len(text) < LONGEST_ERROR + 10
    assert len(str(SessionError("\0" * 1_000_000))) < 5 * LONGEST_ERROR
    assert str(SessionError()) == ""
