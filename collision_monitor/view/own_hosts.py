"""Under which names browsers may reach the page, and pages of which sites may talk to it.

A browser lets every site that it shows open a websocket to this machine, and a site may let its own name lead to this
machine too (DNS rebinding). Both show in the headers of the request: Origin is the site that asks, Host the name by
which it asks. A number as an address cannot be rebound.
"""

from __future__ import annotations

import re
import socket
from collections.abc import Iterable, Mapping
from ipaddress import ip_address
from typing import Final
from urllib.parse import urlsplit

from collision_monitor.errors import InputError

LOCAL: Final = "localhost"

_NAME: Final = re.compile(r"[a-z0-9]([a-z0-9.-]{0,251}[a-z0-9])?")


class OwnHosts:
    """The names of a server. host: the address that it listens at. allowed: further names, such as that of a proxy."""

    def __init__(self, host: str, allowed: Iterable[str] = ()) -> None:
        self._allowed = {_checked(name) for name in allowed}
        self._is_local = _is_loopback(host) or host == LOCAL
        self._own = {LOCAL, host.lower()}
        if not self._is_local:
            name = socket.gethostname().lower()
            self._own |= {name, f"{name}.local", socket.getfqdn().lower()}

    def refusal(self, headers: Mapping[str, str]) -> str:
        """Return why a request with these headers is refused; empty if it is not."""
        try:
            host, origin = headers.get("Host", ""), headers.get("Origin")
        except LookupError:  # several of them
            return "a request with several hosts or origins"
        name = _name_of(host)
        if not self._has(name):
            return f"a request for the host {host!r:.80}"
        if origin is not None:
            site = _split(origin)
            if site is None or not (site[1] == host.lower() or site[0] in self._allowed):
                return f"a request of a page of {origin!r:.80}"
        return ""

    def _has(self, name: str) -> bool:
        if name in self._own or name in self._allowed:
            return True
        return _is_loopback(name) if self._is_local else _is_number(name)


def _checked(name: str) -> str:
    """Return a name in small letters. Raises InputError for an address with a scheme or a port."""
    if not (_NAME.fullmatch(name.lower()) or _is_number(name)):
        raise InputError(f"--allow-host: expected a name such as robot.example, got {name!r}")
    return name.lower()


def _name_of(host: str) -> str:
    """Return the name in a Host header, without the port; empty if there is none."""
    found = _split(f"http://{host}")
    return found[0] if found is not None else ""


def _split(address: str) -> tuple[str, str] | None:
    """Return the name in an address of the web, and the name with the port; None if it is no such address."""
    try:
        parts = urlsplit(address.lower())
        name, _ = parts.hostname, parts.port
    except ValueError:
        return None
    if parts.scheme not in ("http", "https") or not name or parts.path not in ("", "/") or "@" in parts.netloc:
        return None
    return name, parts.netloc


def _is_number(name: str) -> bool:
    try:
        ip_address(name)
    except ValueError:
        return False
    return True


def _is_loopback(name: str) -> bool:
    return _is_number(name) and ip_address(name).is_loopback
