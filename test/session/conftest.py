"""A recorded session for all tests of this folder."""

from __future__ import annotations

from pathlib import Path

import pytest
from session_scene import record


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished session of 50 steps; not to be changed."""
    path = tmp_path_factory.mktemp("session") / "run.mcap"
    record(path)
    return path
