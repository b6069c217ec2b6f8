"""Sessions and messages that the tests of the view share and must not modify."""

from __future__ import annotations

from pathlib import Path

import pytest
from played_session import record_drive

GOLDEN = Path(__file__).parents[1] / "golden" / "balanced.mcap"


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Session in which a cart drives into a post, and a ball turns away."""
    return record_drive(tmp_path_factory.mktemp("drive") / "drive.mcap")


@pytest.fixture(scope="session")
def golden() -> Path:
    """Golden session: six bodies that swing through each other, a wall, and invalid messages."""
    return GOLDEN
