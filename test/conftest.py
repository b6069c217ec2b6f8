"""What every test shares: reproducible examples, a recorded session and a ROS domain of its own."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# The same examples on every run and every machine; HYPOTHESIS_PROFILE=explore looks for new ones.
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

_DOMAINS = range(1, 101)  # beyond 101, DDS ports meet the ephemeral ports of Linux


@pytest.fixture
def ros_domain_id(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A ROS domain that no other test on this machine uses meanwhile, set for this process and its children.

    The claim is an abstract socket: it goes with the process, however that ends.
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


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished session of 50 steps, which no test may change."""
    from session_scene import record  # imports the kernels, which most tests do without

    path = tmp_path_factory.mktemp("session") / "run.mcap"
    record(path)
    return path
