"""Runs one function over many sessions, on all cores or on a Ray cluster, and yields the results in order.

An error in one session, even the end of its process, affects the result of that session only.
"""

from __future__ import annotations

import glob
import logging
import os
import re
import socket
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final, TypeVar

from collision_monitor.errors import CollisionMonitorError, InputError, UnsupportedError
from collision_monitor.session.worker import begin_worker
from collision_monitor.settings.regular_file import FOLDER, NOTHING, found_instead

Result = TypeVar("Result")

ENDED: Final = "its process was killed, possibly for lack of memory"


@dataclass(frozen=True)
class Engine:
    """Where the work runs.

    name: "processes" or "ray". jobs: number of sessions at a time, by default one for each core. address: HOST:PORT
    of a Ray cluster, by default a local one.
    """

    name: str = "processes"
    jobs: int | None = None
    address: str | None = None


ALL_CORES: Final = Engine()


def find_sessions(names: Iterable[str]) -> list[Path]:
    """Return the sessions of the names, which are files, wildcards, and folders with sessions at any depth.

    A folder that a recorder made is one session, whatever the number of its files. Raises InputError for a folder
    without any .mcap file.
    """
    found: list[Path] = []
    for name in names:
        paths = [name] if found_instead(Path(name)) != NOTHING else sorted(glob.glob(name)) or [name]
        for path in map(Path, paths):
            inside = list(_inside(path)) if found_instead(path) == FOLDER else [path]
            if not inside:
                raise InputError(f"{path}: expected a folder with .mcap files, got none")
            found += inside
    return list(dict.fromkeys(found))


def _inside(top: Path) -> Iterator[Path]:
    folders = [top]
    while folders:
        folder = folders.pop()
        files = sorted(folder.glob("*.mcap"))
        parts = [file for file in files if re.fullmatch(re.escape(folder.name) + r"_\d+", file.stem)]
        if files and ((folder / "metadata.yaml").exists() or parts == files):
            yield folder
            continue
        yield from files
        below = [each for each in folder.iterdir() if each.is_dir() and not each.is_symlink()]  # links may form a cycle
        folders += sorted(set(below) - set(files), reverse=True)


def for_each(
    function: Callable[[Path], Result],
    paths: Sequence[Path],
    failed: Callable[[Path, str], Result],
    engine: Engine = ALL_CORES,
) -> Iterator[Result]:
    """Yield function(path) for each path, in order; failed(path, reason) if it raises or its process ends.

    Raises UnsupportedError if the engine is not installed, InputError if it cannot be reached.
    """
    if engine.name == "ray":
        yield from _on_ray(function, paths, failed, engine)
        return
    jobs = min(engine.jobs or os.cpu_count() or 1, len(paths))
    if jobs <= 1:
        yield from (_guarded(function, path, failed) for path in paths)
    else:
        yield from _in_processes(function, paths, failed, jobs)


def _guarded(function: Callable[[Path], Result], path: Path, failed: Callable[[Path, str], Result]) -> Result:
    try:
        return function(path)
    except CollisionMonitorError as error:
        return failed(path, str(error))
    except Exception as error:  # the other sessions still have to run
        return failed(path, f"an error of collision_monitor itself: {error!r}")


def _guarded_in(
    folder: Path, function: Callable[[Path], Result], path: Path, failed: Callable[[Path, str], Result]
) -> Result:
    """Run in the folder that the path is relative to, so that errors name the path as the caller gave it."""
    try:
        if not path.is_absolute():
            os.chdir(folder)
    except OSError as error:
        return failed(path, f"{folder}: expected the same folder on every machine, got: {error.strerror}")
    return _guarded(function, path, failed)


def _in_processes(
    function: Callable[[Path], Result], paths: Sequence[Path], failed: Callable[[Path, str], Result], jobs: int
) -> Iterator[Result]:
    todo = list(paths)
    while todo:
        pool = _pool(jobs)
        try:
            futures = [pool.submit(_guarded, function, path, failed) for path in todo]
            for future in futures:
                yield future.result()
                todo.pop(0)
        except BrokenProcessPool:  # this path or another one ended a process: run it alone
            yield _alone(function, todo.pop(0), failed)
        finally:
            pool.shutdown(cancel_futures=True)


def _alone(function: Callable[[Path], Result], path: Path, failed: Callable[[Path, str], Result]) -> Result:
    with _pool(1) as pool:
        try:
            return pool.submit(_guarded, function, path, failed).result()
        except BrokenProcessPool:
            return failed(path, ENDED)


def _pool(jobs: int) -> ProcessPoolExecutor:
    """Return a pool of spawned processes: a fork of a process with threads may deadlock."""
    return ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=begin_worker)


def _on_ray(
    function: Callable[[Path], Result], paths: Sequence[Path], failed: Callable[[Path, str], Result], engine: Engine
) -> Iterator[Result]:
    """Run on a Ray cluster. Its machines need collision_monitor and the files under the same paths."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # else Ray reports to its developers
    os.environ.setdefault("RAY_worker_niceness", "0")  # else Ray's workers run at a lower priority than other processes
    try:
        import ray
    except ImportError:
        raise UnsupportedError(
            "--engine ray needs Ray, which is not installed: pip install '.[ray]' in a clone"
        ) from None
    if engine.address is not None:
        _reach(engine.address)
    where: dict[str, Any] = {"address": engine.address or "local"}
    if engine.address is None:
        where |= {"num_cpus": engine.jobs, "include_dashboard": False, "_node_ip_address": "127.0.0.1"}
    try:
        ray.init(**where, log_to_driver=False, logging_level=logging.CRITICAL)
    except (ConnectionError, ValueError, RuntimeError, OSError) as error:
        reason = " ".join(str(error).split())
        raise InputError(f"Ray at {engine.address or 'this machine'}: expected a cluster, got: {reason}") from None
    try:
        task = ray.remote(max_retries=0)(_guarded_in)
        references = [task.remote(Path.cwd(), function, path, failed) for path in paths]
        for path, reference in zip(paths, references, strict=True):
            try:
                yield ray.get(reference)
            except ray.exceptions.RayError:
                yield failed(path, ENDED)
    finally:
        ray.shutdown()


def _reach(address: str) -> None:
    """Check that a cluster listens at the address. Raises InputError if not; Ray itself tries for two minutes."""
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if not colon or not port.isdecimal() or not 0 < int(port) < 1 << 16:
        raise InputError(f"address of the Ray cluster: expected HOST:PORT, got {address!r}")
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=10).close()
    except OSError as error:
        raise InputError(f"Ray at {address}: expected a cluster that listens there, got: {error}") from None
