"""The web server of the page: viser on one port, by default for this machine alone."""

from __future__ import annotations

import contextlib
import io
import socket
from typing import TYPE_CHECKING, Final

from collision_monitor.errors import InputError, UnsupportedError

if TYPE_CHECKING:
    import viser

LOOPBACK: Final = "127.0.0.1"
PORT: Final = 8080


def start_server(host: str = LOOPBACK, port: int = PORT) -> viser.ViserServer:
    """Serve an empty page. port: 0 chooses a free one.

    Raises InputError if the address cannot be used, and UnsupportedError without viser.
    """
    try:
        import viser
    except ImportError as error:
        raise UnsupportedError(
            f"view: expected the package viser, got: {error}; `make setup` installs it, or pip install viser"
        ) from None
    chosen = _free_port(host, port)
    with contextlib.redirect_stdout(io.StringIO()):  # its banner
        server = viser.ViserServer(host=host, port=chosen, label="collision_monitor", verbose=False)
    if server.get_port() != chosen:  # another program took it meanwhile, and viser went on to the next one
        stop_server(server)
        raise InputError(f"--port: expected a free port, {chosen} is in use; choose another one, or 0 for any")
    return server


def stop_server(server: viser.ViserServer) -> None:
    """Stop serving; browsers that show the page wait for another server."""
    with contextlib.redirect_stdout(io.StringIO()):  # its last line
        server.stop()


def _free_port(host: str, port: int) -> int:
    """Return the port, or a free one for 0. Raises InputError."""
    try:
        (family, kind, _, _, address), *_ = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        with socket.socket(family, kind) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
            return int(probe.getsockname()[1])
    except socket.gaierror as error:
        raise InputError(
            f"--host: expected the name or address of this machine, got {host!r}: {error.strerror}"
        ) from None
    except PermissionError:
        raise InputError(
            f"--port: expected a port that this user may open, got {port}; choose one above 1023"
        ) from None
    except OSError as error:
        if error.errno == 98:  # EADDRINUSE
            text = f"--port: expected a free port, {port} is in use; choose another one, or 0 for any"
        else:
            text = f"--host: expected an address of this machine, got {host!r}: {error.strerror}"
        raise InputError(text) from None
