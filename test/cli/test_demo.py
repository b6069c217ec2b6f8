"""Tests of the last lines of the demo; `test/ros/test_world_node.py` runs it."""

from __future__ import annotations

from pathlib import Path

import pytest

from collision_monitor.cli.demo import _replay

GOLDEN = Path(__file__).parents[1] / "golden" / "balanced.mcap"


def test_the_size_of_a_folder_is_that_of_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "rec").mkdir()
    (tmp_path / "rec" / "rec_0.mcap").write_bytes(GOLDEN.read_bytes())
    for path in (GOLDEN, tmp_path / "rec"):
        assert _replay(path) == 0
        first = capsys.readouterr().out.splitlines()[0]
        size = f"{GOLDEN.stat().st_size / 1000:.0f} kB"
        assert first.startswith(f"session  {path} (") and first.endswith(f" messages, {size})")
