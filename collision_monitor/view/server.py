"""The web server of the page: viser on one port, by default for this machine alone, for pages of its own only.

viser serves every site and takes every message, and has no setting for it. So its call that starts the server is given
one more check of each request, and its function that reads from a browser is replaced.
"""

from __future__ import annotations

import asyncio
import contextlib
import http
import io
import logging
import socket
import warnings
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, Final

from collision_monitor.errors import InputError, UnsupportedError
from collision_monitor.view.frames import RefusalLines, refused_frame
from collision_monitor.view.own_hosts import OwnHosts

if TYPE_CHECKING:
    import viser

LOOPBACK: Final = "127.0.0.1"
PORT: Final = 8080


def start_server(host: str = LOOPBACK, port: int = PORT, allowed: Iterable[str] = ()) -> viser.ViserServer:
    """Serve an empty page. port: 0 chooses a free one. allowed: further names by which browsers may ask for the page.

    Raises InputError if the address cannot be used, and UnsupportedError without viser.
    """
    try:
        import viser
    except ImportError as error:
        raise UnsupportedError(
            f"view: expected the package viser, got: {error}; `make setup` installs it, or `pip install '.[view]'`"
        ) from None
    hosts = OwnHosts(host, allowed)
    chosen = _free_port(host, port)
    with contextlib.redirect_stdout(io.StringIO()), _guarded(hosts, RefusalLines()):  # the former for its banner
        server = viser.ViserServer(host=host, port=chosen, label="collision_monitor", verbose=False)
    if server.get_port() != chosen:  # another program took it meanwhile, and viser went on to the next one
        stop_server(server)
        raise InputError(f"--port: expected a free port, {chosen} is in use; choose another one, or 0 for any")
    return server


@contextlib.contextmanager
def _guarded(hosts: OwnHosts, lines: RefusalLines) -> Iterator[None]:
    """Guard the server that viser starts meanwhile. Raises UnsupportedError if this viser cannot be guarded."""
    import viser
    from viser.infra import _infra
    from websockets.asyncio import server as sockets
    from websockets.http11 import Request, Response

    serve = sockets.serve
    guarded = []

    def guarded_serve(*arguments: Any, process_request: Any, **options: Any) -> Any:
        def check(connection: Any, request: Request) -> Response | None:
            reason = hosts.refusal(request.headers)
            if not reason:
                return process_request(connection, request)  # type: ignore[no-any-return]
            lines.add(f"{reason}; --allow-host NAME allows a name")
            return connection.respond(http.HTTPStatus.FORBIDDEN, "FORBIDDEN\n")  # type: ignore[no-any-return]

        guarded.append(True)
        logger = logging.getLogger(f"{__name__}.connections")
        logger.filters = [lambda record: _say(record, lines)]  # in place of tracebacks of what is no request
        return serve(*arguments, process_request=check, **(options | {"logger": logger}))

    async def consume(connection: Any, take: Any, kind: Any) -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: lines.add(_what(context)))
        while True:
            raw = await connection.recv()
            try:
                with warnings.catch_warnings(action="ignore"):  # of types, which the check below finds too
                    message = kind.deserialize(raw)
                reason = refused_frame(message)
            except Exception as error:  # it raises whatever the bytes lead to
                reason = f"a frame that is no message: {type(error).__name__} {error!s:.80}"
            if reason:
                lines.add(reason)
            else:
                take(message)

    if not hasattr(_infra, "_message_consumer"):
        raise UnsupportedError(f"view: expected viser 1.1, got {viser.__version__}, which cannot be guarded")
    _infra._message_consumer = consume  # type: ignore[assignment]
    sockets.serve = guarded_serve  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        sockets.serve = serve  # type: ignore[misc]
    if not guarded:
        raise UnsupportedError(f"view: expected viser 1.1, got {viser.__version__}, which cannot be guarded")


def _say(record: logging.LogRecord, lines: RefusalLines) -> bool:
    """Print a warning or an error of a connection in one line; nothing goes on to the log.

    Browsers open connections that they close without a request. That is no error.
    """
    from websockets.exceptions import ConnectionClosed

    error = record.exc_info[1] if record.exc_info else None
    was_closed = isinstance(error, ConnectionClosed) or isinstance(getattr(error, "__cause__", None), EOFError)
    if record.levelno >= logging.WARNING and not was_closed:
        lines.add(f"a connection: {record.getMessage()}" + (f": {error!r:.200}" if error is not None else ""))
    return False


def _what(context: dict[str, Any]) -> str:
    error = context.get("exception")
    return f"what a message asked for: {error!r:.200}" if error is not None else str(context.get("message", ""))


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
