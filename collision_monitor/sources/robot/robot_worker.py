"""A process that makes one robot of a large URDF: it reads the job from its standard input and writes the robot.

It is a process, not a thread, because the readers of XML and of meshes hold Python's lock. The two processes are one
program, so the robot comes back by pickle.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys

from collision_monitor.errors import reason_of
from collision_monitor.pipeline.model_worker import JOB, limit_this_process, receive, send
from collision_monitor.robots.robot import Robot


def main() -> None:
    """Make the robot, or a text that says why there is none."""
    limit_this_process()
    results = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # a library's output must not mix with the result
    job = receive(sys.stdin.buffer)
    limit, _ = JOB.unpack_from(job)
    signal.setitimer(signal.ITIMER_REAL, limit)
    try:
        made = pickle.dumps(Robot(*pickle.loads(job[JOB.size :])))
    except Exception as error:  # see `reason_of`
        made = pickle.dumps(reason_of(error))
    send(results, made)


if __name__ == "__main__":
    main()
