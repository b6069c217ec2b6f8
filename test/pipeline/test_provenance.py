"""The determinism key names what answers depend on, and nothing else."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from collision_monitor._jit import imports
from collision_monitor.pipeline import provenance

PACKAGE = Path(provenance.__file__).parents[1]


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Yield a copy of the package; the key is computed from its source files."""
    folder = tmp_path / "collision_monitor"
    shutil.copytree(PACKAGE, folder, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(imports, "_PACKAGE", folder)
    _forget()
    yield folder
    _forget()


def _forget() -> None:
    imports.direct_imports.cache_clear()
    imports.source_file.cache_clear()
    provenance.provenance.cache_clear()


def _key() -> str:
    _forget()
    return provenance.provenance()["determinism_key"]


def _edit(path: Path, change: Callable[[str], str]) -> None:
    before = path.read_text()
    after = change(before)
    assert after != before
    path.write_text(after)


@pytest.fixture(scope="module")
def before() -> str:
    """The key of the package as it is."""
    key = _key()
    _forget()
    return key


def test_the_key_is_that_of_the_source_files(before: str, package: Path) -> None:
    assert _key() == before


def test_a_changed_docstring_or_comment_changes_nothing(before: str, package: Path) -> None:
    for module in ("motion/motion.py", "monitor/monitor.py", "codec/cdr.py", "report/page.py"):
        path = package / module
        _edit(path, lambda text: re.sub(r'^"""', '"""Another first line.\n\n', text, count=1))
        _edit(path, lambda text: re.sub(r'(\n +""")(\w)', r"\1Other words.\n\n    \2", text))
        _edit(path, lambda text: text + "\n\n# a last word\n")
    assert _key() == before


@pytest.mark.parametrize(
    ("module", "old", "new"),
    [
        ("motion/motion.py", "0.5", "0.25"),
        ("tolerances.py", "1e-", "2e-"),
        ("monitor/monitor.py", " + ", " - "),
        ("codec/cdr.py", '"<I"', '">I"'),
    ],
)
def test_a_changed_number_or_operation_changes_the_key(
    before: str, package: Path, module: str, old: str, new: str
) -> None:
    _edit(package / module, lambda text: text.replace(old, new))
    assert _key() != before


def test_what_gives_no_answers_has_no_part_in_it(before: str, package: Path) -> None:
    for folder in ("report", "ros", "cli", "session", "sources", "world", "accuracy"):
        files = list((package / folder).rglob("*.py"))
        assert files
        for path in files:
            _edit(path, lambda text: text + "\nANOTHER = 1\n")
    assert _key() == before


def test_the_order_of_a_set_in_the_code_has_no_part_in_it() -> None:
    code = provenance._constant
    assert code(frozenset("ab")) == code(frozenset("ba")) != code(frozenset("ac"))
