"""Sessions that the tests of this folder share and must not modify."""

from __future__ import annotations

from pathlib import Path

import pytest
from played_session import record_drive, record_scene


@pytest.fixture(scope="session")
def crossing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Session of 7 s of the scene crossing, whose times of contact are known in closed form."""
    return record_scene(tmp_path_factory.mktemp("crossing") / "crossing.mcap", "crossing", 7.0)


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Session in which a cart drives into a post, and a ball turns away before it would hit the cart's track."""
    return record_drive(tmp_path_factory.mktemp("drive") / "drive.mcap")
