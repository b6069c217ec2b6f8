"""A process that makes expensive models: jobs on its standard input, models on its standard output, one at a time.

It is a process, not a thread, because libraries below it hold Python's lock, can fail for lack of memory, or crash. It
has limits of time and memory that the kernel enforces, so that it cannot outlive them. It ends with its parent.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import pickle
import resource
import signal
import struct
import sys
from collections.abc import Sequence
from typing import IO, Any, Final

LIMIT_S: Final = 30.0
"""s for one model; the decomposition of an ordinary mesh takes 1 to 10 s. Longer: others wait for their models."""

LIMIT_BYTES: Final = 4 << 30
"""Address space of the process. Its libraries take 1 to 2 GiB of it. Larger: the monitor itself may find no memory."""

START_S: Final = 120
"""s until the first job is read: the kernels may have to be compiled."""

NICENESS: Final = 10
"""The monitor's own threads come first."""

HEADER: Final = struct.Struct("<Q")
"""Length of the pickle that follows."""

COMMAND: Final = (sys.executable, "-m", "collision_monitor.pipeline.model_worker")

ENVIRONMENT: Final = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")}
"""One thread, so that the monitor keeps the other cores."""

_PR_SET_PDEATHSIG: Final = 1


def send(stream: IO[bytes], value: Any) -> None:
    """Write one value. Raises OSError if the other side has ended."""
    data = pickle.dumps(value, pickle.HIGHEST_PROTOCOL)
    stream.write(HEADER.pack(len(data)) + data)
    stream.flush()


def receive(stream: IO[bytes]) -> Any:
    """Read one value. Raises EOFError if the other side has ended."""
    head = stream.read(HEADER.size)
    if len(head) < HEADER.size:
        raise EOFError
    size = HEADER.unpack(head)[0]
    data = stream.read(size)
    if len(data) < size:
        raise EOFError
    return pickle.loads(data)  # from our own process, over a pipe that nobody else has


def _limit() -> None:
    signal.alarm(START_S)  # its default action ends the process, also within native code
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the monitor, which ends this process
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_AS, (LIMIT_BYTES, LIMIT_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.nice(NICENESS)
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _made(shapes: Sequence[Any], model: Any) -> Any:
    """Return the model with the corners of its hulls, or a text that says why there is none."""
    from collision_monitor.errors import reason_of
    from collision_monitor.geometry.qhull import hull_vertices
    from collision_monitor.geometry.shapes import ConvexHull
    from collision_monitor.objects.models import monitored_model

    try:
        found = monitored_model(shapes, model)
        corners = (hull_vertices(piece.points) if isinstance(piece, ConvexHull) else None for piece, _ in found.pieces)
        return found._replace(corners=tuple(corners))
    except Exception as error:  # see `reason_of`
        return reason_of(error)


def main() -> None:
    """Process jobs (shapes, model, s) until the parent closes the pipe."""
    _limit()
    results = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no result
    while True:  # ends with the parent, at the limit of time, or when the pipe is closed
        try:
            shapes, model, limit = receive(sys.stdin.buffer)
        except EOFError:
            return
        signal.setitimer(signal.ITIMER_REAL, limit)
        result = _made(shapes, model)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        send(results, result)


if __name__ == "__main__":
    main()
