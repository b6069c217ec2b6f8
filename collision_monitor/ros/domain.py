"""A free ROS domain, so that two sessions on one machine do not receive each other's messages."""

from __future__ import annotations

import random
import socket

from collision_monitor.errors import InputError

DOMAINS = range(1, 102)
"""Beyond these, DDS ports overlap the ephemeral ports of Linux."""


def free_domain() -> int:
    """Return a domain that no process on this machine uses.

    The first participant of a domain binds the port that is probed here (DDSI-RTPS 9.6.1).
    """
    for domain in random.sample(DOMAINS, len(DOMAINS)):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("", 7400 + 250 * domain + 10))
            except OSError:
                continue
            return domain
    raise InputError(
        f"expected a free ROS domain from {DOMAINS[0]} to {DOMAINS[-1]}, all are in use; choose one with ROS_DOMAIN_ID"
    )
