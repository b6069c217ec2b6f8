"""Paths that lead to no regular file, or to too much of one: each reader refuses them at once, with a text."""

from __future__ import annotations

import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from no_files import NO_FILES, sparse

from collision_monitor.errors import CollisionMonitorError, InputError, SessionError, ShapeError
from collision_monitor.settings.regular_file import found_instead, open_regular, read_regular


@pytest.mark.parametrize("kind", NO_FILES)
@pytest.mark.parametrize("refused", [InputError, SessionError, ShapeError])
def test_what_is_no_regular_file_is_called_by_its_name(
    kind: str, refused: type[CollisionMonitorError], tmp_path: Path
) -> None:
    make, text = NO_FILES[kind]
    path = make(tmp_path / "path")
    with pytest.raises(refused, match="expected a mesh file, got") as caught:
        open_regular(path, "a mesh file", refused=refused)
    assert text in str(caught.value) and type(caught.value) is refused
    if kind == "LFS pointer":
        assert "git lfs pull" in str(caught.value)
    else:
        assert text in found_instead(path)


def test_a_regular_file_is_read_up_to_its_limit(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"0123456789")
    assert read_regular(path, most=10) == b"0123456789"
    assert found_instead(path) == ""
    link = tmp_path / "link"
    link.symlink_to(path)
    assert read_regular(link, most=10) == b"0123456789"
    with pytest.raises(InputError, match="expected YAML, of at most 9 bytes, got 10"):
        read_regular(path, "YAML", most=9)
    with pytest.raises(InputError, match="of at most 1000 bytes, got 1099511627776"):
        open_regular(sparse(tmp_path / "sparse"), most=1000)
    with pytest.raises(InputError, match="null"):
        open_regular(Path("a\0b"))


def test_files_without_a_size_end_at_the_limit_and_do_not_wait() -> None:
    """Linux has regular files without a size: those in /proc hold more than they say, some wait for something."""
    with pytest.raises(InputError, match="at most 100 bytes, got more"):
        read_regular(Path("/proc/cpuinfo"), most=100)
    assert b"MemTotal" in read_regular(Path("/proc/meminfo"), most=1 << 20)


def test_a_file_without_permission_says_so(tmp_path: Path) -> None:
    """In a process of another user, because root may read everything."""
    (tmp_path / "secret").write_text("x")
    (tmp_path / "secret").chmod(0)
    tmp_path.chmod(0o755)
    code = """
        import os
        from pathlib import Path
        from collision_monitor.errors import InputError
        from collision_monitor.settings.regular_file import open_regular
        if os.getuid() == 0:
            os.setuid(65534)
        try:
            open_regular(Path("secret"))
        except InputError as error:
            print(error)
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], cwd=tmp_path, capture_output=True, text=True)
    assert done.stdout == "secret: expected a file that can be read, got Permission denied\n", done.stderr
