"""Tests of the processes that the demo starts."""

from __future__ import annotations

import time

import pytest

from collision_monitor.cli.child import Child, ProcessError


def wait_for(child: Child) -> None:
    while child.running():
        time.sleep(0.02)


def test_a_process_that_fails_is_reported_with_its_last_words() -> None:
    expected = r"^collision-monitor replay: exit code 1; it said:\n  collision-monitor: error: .*none\.mcap"
    with Child("replay", "none.mcap") as child, pytest.raises(ProcessError, match=expected):
        wait_for(child)
