"""Tests that a kernel's cache folder depends on the content of its module and of all its imports."""

from __future__ import annotations

import sys
import types
from collections.abc import Iterator
from pathlib import Path

import pytest

from collision_monitor._jit import cache, imports

TOP = "from collision_monitor.middle import (\n    sum_of,\n)\n"
MIDDLE = "from collision_monitor import bottom\n"


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    folder = tmp_path / "collision_monitor"
    folder.mkdir()
    for name, text in (("top", TOP), ("middle", MIDDLE), ("bottom", "ONE = 1\n"), ("beside", "TWO = 2\n")):
        (folder / f"{name}.py").write_text(text)
    monkeypatch.setattr(imports, "_PACKAGE", folder)
    _forget()
    yield folder
    _forget()


def _forget() -> None:
    for cached in (cache.folder, cache._file_digest, imports.direct_imports, imports.source_file):
        cached.cache_clear()


def test_a_change_below_a_module_renames_its_folder_and_no_other(package: Path) -> None:
    names = ("top", "middle", "bottom", "beside")
    before = {name: cache.folder(f"collision_monitor.{name}") for name in names}
    (package / "bottom.py").write_text("ONE = 3\n")
    _forget()
    changed = {name for name in names if cache.folder(f"collision_monitor.{name}") != before[name]}
    assert changed == {"top", "middle", "bottom"}


def test_the_same_content_gives_the_same_folder(package: Path) -> None:
    before = cache.folder("collision_monitor.top")
    _forget()
    assert cache.folder("collision_monitor.top") == before


def test_a_kernel_outside_the_package_is_compiled_anew_when_the_package_changes(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A benchmark inlines kernels of the package. Once, it kept measuring their code of the day before."""
    script = types.ModuleType("a_benchmark")
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    script.__file__ = str(folder / "a_benchmark.py")
    Path(script.__file__).write_text("from collision_monitor.top import sum_of\n")
    monkeypatch.setitem(sys.modules, "a_benchmark", script)
    before = cache.folder("a_benchmark")
    (package / "bottom.py").write_text("ONE = 3\n")
    _forget()
    assert cache.folder("a_benchmark") != before
