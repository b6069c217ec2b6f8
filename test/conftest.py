"""Fixtures and settings of all tests: reproducible examples, a recorded session and an unused ROS domain."""

from __future__ import annotations

import gc
import os
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings

if TYPE_CHECKING:
    from started_threads import StartedThreads

# The same examples on every run and every machine; HYPOTHESIS_PROFILE=explore searches for new ones.
settings.register_profile(
    "same",
    derandomize=True,
    max_examples=100,
    deadline=None,  # the first example may compile a kernel
    database=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("explore", max_examples=2000, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Collect tests without the collector of garbage, which would examine thousands of tests again and again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


_DOMAINS = range(1, 101)  # from 102 on, DDS ports are in the range of the ephemeral ports of Linux


@pytest.fixture
def ros_domain_id(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """ROS domain that no other test on this machine uses at the time, set for this process and its children.

    An abstract socket claims the domain. The kernel releases it when the process ends in any way.
    """
    first = os.getpid() % len(_DOMAINS)
    for domain in (*_DOMAINS[first:], *_DOMAINS[:first]):
        claim = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            claim.bind(f"\0collision_monitor_test_domain_{domain}")
        except OSError:
            claim.close()
            continue
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        with claim:
            yield domain
        return
    raise RuntimeError("every ROS domain from 1 to 100 is claimed by another test")


@pytest.fixture
def started_threads() -> Iterator[StartedThreads]:
    """Threads start in the smallest scene, and the number of those that worked at once is counted."""
    from started_threads import threads_start  # imports the kernels too

    with threads_start() as started:
        yield started


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Path of a finished session of 50 steps, which tests must not change."""
    from session_scene import record  # imported here, as it imports the kernels, which most tests do not need

    path = tmp_path_factory.mktemp("session") / "run.mcap"
    record(path)
    return path
