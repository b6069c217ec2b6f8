"""A process that makes expensive models: it reads jobs from its standard input and writes models, one at a time.

It is a process, not a thread, because libraries below it hold Python's lock, can fail for lack of memory, or crash. It
has limits of time and memory that the kernel enforces, so that it cannot outlive them. It ends with its parent.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import signal
import struct
import sys
from typing import IO, Final

LIMIT_S: Final = 30.0
"""s for one model; the decomposition of an ordinary mesh takes 1 to 10 s. Longer: others wait for their models."""

LIMIT_BYTES: Final = 4 << 30
"""Address space of the process. Its libraries take 1 to 2 GiB of it. Larger: the monitor itself may find no memory."""

START_S: Final = 120
"""s until the first job is read: the kernels may have to be compiled."""

NICENESS: Final = 10
"""The monitor's own threads come first."""

LENGTH: Final = struct.Struct("<Q")
"""Length of the bytes that follow."""

JOB: Final = struct.Struct("<dB")
"""Limit (s) and number of the model, followed by an ObjectDescriptionArray with one object."""

COMMAND: Final = (sys.executable, "-m", "collision_monitor.pipeline.model_worker")

ENVIRONMENT: Final = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")}
"""One thread, so that the monitor keeps the other cores."""

_PR_SET_PDEATHSIG: Final = 1


def send(stream: IO[bytes], data: bytes) -> None:
    """Write a job or a model. Raises OSError if the other side has ended."""
    stream.write(LENGTH.pack(len(data)) + data)
    stream.flush()


def receive(stream: IO[bytes]) -> bytes:
    """Read a job or a model. Raises EOFError if the other side has ended."""
    head = stream.read(LENGTH.size)
    if len(head) < LENGTH.size:
        raise EOFError
    size = LENGTH.unpack(head)[0]
    data = stream.read(size)
    if len(data) < size:
        raise EOFError
    return data


def limit_this_process() -> None:
    """Set the limits of time, memory and priority, and end with the parent."""
    signal.alarm(START_S)  # its default action ends the process, also within native code
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the monitor, which ends this process
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_AS, (LIMIT_BYTES, LIMIT_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.nice(NICENESS)
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _make(data: bytes, number: int) -> bytes:
    """Return the model with the corners of its hulls, or a text that says why there is none; as `encode_model` does."""
    from collision_monitor.codec import decode_descriptions
    from collision_monitor.errors import reason_of
    from collision_monitor.geometry.qhull import hull_vertices
    from collision_monitor.objects.description import ObjectDescription
    from collision_monitor.objects.models import monitored_model
    from collision_monitor.pipeline.model_message import encode_model
    from collision_monitor.records import Model
    from collision_monitor.shapes.registry import ConvexHull

    try:
        (description,) = decode_descriptions(data).objects
        assert isinstance(description, ObjectDescription)
        found = monitored_model(description.shapes, Model(number))
        corners = (hull_vertices(piece.points) if isinstance(piece, ConvexHull) else None for piece, _ in found.pieces)
        return encode_model(found._replace(corners=tuple(corners)))
    except Exception as error:  # see `reason_of`
        return encode_model(reason_of(error))


def main() -> None:
    """Process jobs until the parent closes the pipe."""
    limit_this_process()
    results = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # a library's output must not mix with the models
    while True:  # ends with the parent, at the limit of time, or when the pipe is closed
        try:
            job = receive(sys.stdin.buffer)
        except EOFError:
            return
        limit, number = JOB.unpack_from(job)
        signal.setitimer(signal.ITIMER_REAL, limit)
        result = _make(job[JOB.size :], number)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        send(results, result)


if __name__ == "__main__":
    main()
