"""Models that take long are made beside the monitoring. Until then, the object is monitored by its bounding box.

What an object of a message costs is estimated before anything is computed (`preparation_cost`). An object beyond the
message's budget is described with the model AABB, which takes linear time, and its own model is made in another process
(`model_worker`). If it is ready in time, the object is described again. A session holds the messages as the monitor
took them, so a replay needs no clock and makes the expensive models itself.
"""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
import threading
from collections import OrderedDict
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from collision_monitor.objects.description import ObjectDescription
from collision_monitor.objects.models import Modelled
from collision_monitor.pipeline.model_message import decode_model
from collision_monitor.pipeline.model_worker import COMMAND, ENVIRONMENT, JOB, LIMIT_BYTES, LIMIT_S, receive, send
from collision_monitor.records import Model
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import ConvexHull, Mesh, Points, Polygon, Shape

MOST_WAITING: Final = 64 << 20
"""Bytes of points and faces that may wait for their models. Objects beyond it keep their boxes, which is logged."""

KEPT_MODELS: Final = 64 << 20
"""Bytes of the finished models that are kept for objects that are described again."""

STAYS: Final = "stays with the model aabb"
"""In the texts about objects without their own models. The clock decides about them, so a replay does not repeat them.
"""


@dataclass(frozen=True, eq=False)
class Job:
    """An object that waits for its own model.

    data: the message that will describe it again; description: the object in it. coarse: what the monitor took instead.
    """

    data: bytes
    description: ObjectDescription
    coarse: ObjectDescription
    model: Model

    @property
    def object_id(self) -> int:
        """The object's id."""
        return self.description.object_id


@dataclass(frozen=True, eq=False)
class Prepared:
    """A job and its end: the model, or a text that says why there is none."""

    job: Job
    result: Modelled | str


class Preparation:
    """Makes models in another process, one after the other, in the order of the descriptions.

    limit: s for each; 0: no model is made, and the objects that take long keep their boxes.
    """

    def __init__(self, limit: float = LIMIT_S) -> None:
        self._limit = limit
        self._wake = threading.Condition()
        self._waiting: OrderedDict[int, Job] = OrderedDict()  # by object: only its last description is of use
        self._waiting_bytes = 0
        self._ended: list[Prepared] = []
        self._models: OrderedDict[bytes, tuple[Modelled, int]] = OrderedDict()
        self._process: subprocess.Popen[bytes] | None = None
        self._thread: threading.Thread | None = None
        self._closed = False

    def result(self, description: ObjectDescription, model: Model) -> Modelled | None:
        """Return the finished model of an object of such shapes, if there is one."""
        key = _key(description.shapes, model)
        with self._wake:
            if key not in self._models:
                return None
            self._models.move_to_end(key)
            return self._models[key][0]

    def start(self, job: Job) -> None:
        """Begin to make the model of an object. A job of the same object that still waits is dropped."""
        with self._wake:
            old = self._waiting.pop(job.object_id, None)
            self._waiting_bytes -= len(old.data) if old is not None else 0
            if self._limit <= 0.0:
                self._ended.append(Prepared(job, "no time is allowed for models"))
                return
            if self._closed or self._waiting_bytes + len(job.data) > MOST_WAITING:
                self._ended.append(Prepared(job, "too many objects wait for their models"))
                return
            self._waiting[job.object_id] = job
            self._waiting_bytes += len(job.data)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="preparation", daemon=True)
                self._thread.start()
            self._wake.notify()

    def ended(self) -> list[Prepared]:
        """Return what ended since the last call, in order."""
        with self._wake:
            ended, self._ended = self._ended, []
        return ended

    def close(self) -> None:
        """End the process. What waits keeps its box."""
        with self._wake:
            self._closed = True
            self._waiting.clear()
            self._wake.notify()
            if self._process is not None:
                self._process.kill()
        if self._thread is not None:
            self._thread.join(1.0)

    # -- the thread's side

    def _run(self) -> None:
        while True:  # until `close`
            with self._wake:
                self._wake.wait_for(lambda: self._waiting or self._closed)
                if self._closed:
                    return
                _, job = self._waiting.popitem(last=False)
                self._waiting_bytes -= len(job.data)
            result = self.result(job.description, job.model) or self._made(job)
            self._keep(job, result)

    def _made(self, job: Job) -> Modelled | str:
        process = self._started()
        if process is None:
            return "the monitor ends"
        assert process.stdin is not None and process.stdout is not None
        try:
            send(process.stdin, JOB.pack(self._limit, job.model) + job.data)
            return decode_model(receive(process.stdout))
        except (OSError, EOFError, ValueError):  # it ended, or wrote something that is no model
            return self._why_it_ended(process)

    def _started(self) -> subprocess.Popen[bytes] | None:
        """Return the process. It is started by this thread, with whose end the kernel ends it. None: closed."""
        with self._wake:
            if self._closed:
                return None
            if self._process is None:
                path = os.pathsep.join(each for each in sys.path if each)
                self._process = subprocess.Popen(
                    COMMAND,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    env={**os.environ, **ENVIRONMENT, "PYTHONPATH": path},
                )
            return self._process

    def _why_it_ended(self, process: subprocess.Popen[bytes]) -> str:
        process.kill()
        code = process.wait()
        for stream in (process.stdin, process.stdout):
            with suppress(OSError):
                stream.close()  # type: ignore[union-attr]
        with self._wake:
            self._process = None
        if code == -signal.SIGALRM:
            return f"the model takes longer than {self._limit:g} s"
        return f"the process that makes models ended ({code}; its limit is {LIMIT_BYTES >> 30} GiB)"

    def _keep(self, job: Job, result: Modelled | str) -> None:
        with self._wake:
            self._ended.append(Prepared(job, result))
            if isinstance(result, str):
                return
            self._models[_key(job.description.shapes, job.model)] = result, _size(result.pieces)
            while sum(size for _, size in self._models.values()) > KEPT_MODELS:
                self._models.popitem(last=False)  # terminates: one less in each turn


def _arrays(shape: Shape) -> tuple[Any, ...]:
    match shape:
        case Mesh():
            return shape.vertices, shape.faces
        case ConvexHull():
            return (shape.points,)
        case Points() | Polygon():
            return shape.points, np.array([shape.radius])
    return (np.frombuffer(repr(shape).encode(), np.uint8),)


def _size(shapes: Sequence[tuple[Shape, Pose]]) -> int:
    return sum(array.nbytes + 200 for shape, _ in shapes for array in _arrays(shape))


def _key(shapes: Sequence[tuple[Shape, Pose]], model: Model) -> bytes:
    """Digest of everything that a model depends on."""
    digest = hashlib.blake2b(model.name.encode(), digest_size=16)
    for shape, pose in shapes:
        digest.update(type(shape).__name__.encode() + pose.position.tobytes() + pose.quaternion.tobytes())
        for array in _arrays(shape):
            digest.update(str(array.shape).encode() + np.ascontiguousarray(array).tobytes())
    return digest.digest()
