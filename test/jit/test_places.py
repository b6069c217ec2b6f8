"""Compiled kernels are read wherever they may be read, written wherever they may be, and never trusted blindly."""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROGRAM = """
import logging, os, sys
logging.basicConfig(stream=sys.stdout, format="%(message)s")
from numba.core import event
from doubling import doubled, tripled
user, cache = int(os.environ["BECOMES"]), os.environ.pop("NUMBA_CACHE_DIR", None)
if user:  # who may not read Python's own files, so all that a compilation imports is imported before
    os.environ["NUMBA_CACHE_DIR"] = os.environ["FIRST_CACHE"]
    tripled(1.5)
    del os.environ["NUMBA_CACHE_DIR"]
    os.setgroups([])
    os.setgid(user)
    os.setuid(user)
if cache:
    os.environ["NUMBA_CACHE_DIR"] = cache
compiled = []

class Listener(event.Listener):
    def on_start(self, e): compiled.append(e)
    def on_end(self, e): pass

event.register("numba:compile", Listener())
print(doubled(1.5), len(compiled))
"""
NOBODY = 65_534
NAMELESS = 54_321
"""A user without an entry in the list of users."""

as_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root can be another user")


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder that every user can enter, with a kernel in it."""
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        folder = Path(name)
        folder.chmod(0o755)
        named = (2.0, "doubled"), (3.0, "tripled")
        functions = (f"@kernel\ndef {name}(x):\n    return {k} * x\n" for k, name in named)
        (folder / "doubling.py").write_text("from collision_monitor._jit import kernel\n\n" + "\n".join(functions))
        yield folder


def run(folder: Path, user: int = 0, **variables: str) -> str:
    """Call the kernel in a process of its own, by this user. Return the answer and how many functions it compiled."""
    known = ("HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR", "TMPDIR")
    environment = {key: value for key, value in os.environ.items() if key not in known}
    environment |= {"PYTHONPATH": f"{folder}:{ROOT}", "PYTHONDONTWRITEBYTECODE": "1", **variables}
    environment |= {"BECOMES": str(user), "FIRST_CACHE": str(folder / "first")}
    done = subprocess.run([sys.executable, "-c", PROGRAM], env=environment, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_warm_cache_that_cannot_be_written_costs_no_compilation(folder: Path) -> None:
    cache = str(folder / "cache")
    assert run(folder, NUMBA_CACHE_DIR=cache) == "3.0 1\n"
    for path in (*(folder / "cache").rglob("*"), folder / "cache"):
        assert stat.S_IMODE(path.stat().st_mode) == (0o755 if path.is_dir() else 0o644), "for everyone to read"
        if path.is_dir():
            path.chmod(0o555)
    user = NOBODY if os.geteuid() == 0 else 0
    assert run(folder, user, NUMBA_CACHE_DIR=cache) == "3.0 0\n"


@as_root
def test_a_user_without_a_name_and_a_home_keeps_them_in_a_temporary_folder(folder: Path) -> None:
    temporary = folder / "temporary"
    temporary.mkdir()
    temporary.chmod(0o1777)
    assert [run(folder, NAMELESS, TMPDIR=str(temporary)) for _ in range(2)] == ["3.0 1\n", "3.0 0\n"]
    (kept,) = temporary.iterdir()
    assert (kept.name, kept.stat().st_uid) == (f"collision_monitor_{NAMELESS}", NAMELESS)


@as_root
def test_without_any_place_they_last_as_long_as_the_process(folder: Path) -> None:
    """As in a container whose file system is read-only."""
    read_only = "mount --rbind / /mnt && mount -o remount,bind,ro /mnt && exec chroot /mnt"
    readable = ["unshare", "--mount", "sh", "-c", f'{read_only} "$@"', "sh"]
    if not shutil.which("unshare") or subprocess.run([*readable, "true"], capture_output=True).returncode:
        pytest.skip("no file system can be mounted read-only here")
    environment = {"PYTHONPATH": f"{folder}:{ROOT}", "PATH": os.environ["PATH"], "BECOMES": "0"}
    program = f"import os; os.environ['TMPDIR'] = '/no/such/folder'\n{PROGRAM}"
    command = [*readable, sys.executable, "-c", program]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "3.0 1\n"), done.stderr


@pytest.mark.parametrize("mode", [0o1777, 0o775])
def test_a_folder_that_others_may_write_is_not_trusted(folder: Path, mode: int) -> None:
    cache = folder / "cache"
    assert run(folder, NUMBA_CACHE_DIR=str(cache)) == "3.0 1\n"
    cache.chmod(mode)
    said = run(folder, NUMBA_CACHE_DIR=str(cache))
    assert said.endswith("3.0 1\n") and "expected a folder that nobody else may write to" in said


@as_root
@pytest.mark.parametrize("what", ["folder", "kernels", "file"])
def test_what_another_user_owns_is_not_trusted(folder: Path, what: str) -> None:
    """Only the owner of NUMBA_CACHE_DIR, whom its user names, may be another user."""
    cache = folder / "cache"
    run(folder, NUMBA_CACHE_DIR=str(cache))
    (kernels,) = cache.iterdir()
    (file,) = kernels.iterdir()
    os.chown({"folder": cache, "kernels": kernels, "file": file}[what], NOBODY, NOBODY)
    compiled = run(folder, NUMBA_CACHE_DIR=str(cache)).split()[-1]
    assert compiled == ("0" if what == "folder" else "1")
