"""Damaged copies of the files of others: each is read or refused with one line, within limits."""

from __future__ import annotations

from pathlib import Path

import fuzz_inputs
import pytest
from fuzz_inputs import BASES, answer, bases, damaged, run

FILES = 150


@pytest.mark.parametrize("kind", BASES)
def test_damaged_files_are_read_or_refused(kind: str, tmp_path: Path) -> None:
    found = run(range(FILES), [kind], tmp_path)
    assert found.problems == {}
    assert sum(found.outcomes.values()) == found.files == FILES
    assert {text.partition(": ")[2].partition(",")[0] for text in found.outcomes} == {"read", "refused"}


@pytest.mark.parametrize("kind", BASES)
def test_whole_files_are_read(kind: str, tmp_path: Path) -> None:
    for number, (suffix, data) in enumerate(bases(kind)):
        path = tmp_path / f"{number}{suffix}"
        path.write_bytes(data)
        outcome = answer(kind, path)
        assert outcome.text.startswith("read") and not outcome.problem, (suffix, outcome)


def test_a_seed_always_gives_the_same_file_and_what_raises_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert damaged("mesh", 7) == damaged("mesh", 7) != damaged("mesh", 8)
    monkeypatch.setitem(fuzz_inputs.READERS, "mesh", lambda path: str(1 // 0))
    found = run(range(7, 8), ["mesh"], tmp_path, tmp_path / "kept")
    assert "ZeroDivisionError" in found.problems[7]
    assert [path.read_bytes() for path in (tmp_path / "kept").iterdir()] == [damaged("mesh", 7)[1]]
