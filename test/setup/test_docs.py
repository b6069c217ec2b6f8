"""The examples of the docs run, and the names, files and tests that the docs list exist."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import pytest

import collision_monitor as cm

ROOT = Path(__file__).parents[2]
METHODS = (ROOT / "docs" / "methods.md").read_text()
EXAMPLES = {
    f"{name} {k}": text
    for name in ("geometry", "response")
    for k, text in enumerate(
        re.findall(r"```python\n(# example\n.*?)```", (ROOT / "docs" / f"{name}.md").read_text(), re.DOTALL)
    )
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_runs_and_its_assertions_hold(name: str) -> None:
    assert "assert" in EXAMPLES[name]
    exec(compile(EXAMPLES[name], name, "exec"), {})


def test_there_are_examples() -> None:
    assert sum(name.startswith("geometry") for name in EXAMPLES) >= 6
    assert any(name.startswith("response") for name in EXAMPLES)


@pytest.mark.parametrize("name", sorted(set(re.findall(r"`cm\.([a-zA-Z_.]+)", METHODS))))
def test_every_public_name_resolves(name: str) -> None:
    found: object = cm
    for part in name.split("."):
        found = getattr(found, part)


MODULES = sorted(set(re.findall(r"`((?:geometry|monitor|broad_phase|detection)\.[\w.]+)`", METHODS)))


@pytest.mark.parametrize("name", MODULES)
def test_every_module_imports(name: str) -> None:
    assert import_module(f"collision_monitor.{name}")


@pytest.mark.parametrize(("name", "functions"), re.findall(r"`([\w.]+)` \(((?:`\w+`(?:, )?)+)\)", METHODS))
def test_every_function_that_is_listed_behind_a_module_is_there(name: str, functions: str) -> None:
    for function in re.findall(r"\w+", functions):
        assert callable(getattr(import_module(f"collision_monitor.{name}"), function))


def test_functions_are_listed_behind_modules() -> None:
    assert len(re.findall(r"` \(`", METHODS)) >= 5


@pytest.mark.parametrize("path", sorted(set(re.findall(r"`(test/\S+\.py)`", METHODS))))
def test_every_listed_test_exists(path: str) -> None:
    assert (ROOT / path).exists()


DOCUMENTS = sorted((ROOT / "docs").glob("*.md"))
WORD = r"[A-Za-z_]\w*"


def named_in_files(text: str) -> set[tuple[str, str]]:
    """Files and names of a text that says `Name.method` in [the/file.py](…), or `NAME` in `the/file.py`."""
    text = " ".join(text.split())
    names = rf"`((?:{WORD}\.)*{WORD})`(?:,? (?:and|or) `((?:{WORD}\.)*{WORD})`)?"
    found = set()
    for one, other, linked, path in re.findall(rf"{names} in (?:\[[^]]*\]\(\.\./([\w/]+\.py)\)|`([\w/]+\.py)`)", text):
        file = linked or (path if path.startswith("test/") else f"collision_monitor/{path}")
        found |= {(file, name) for name in (one, other) if name}
    return found


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.stem)
def test_what_a_document_says_to_be_in_a_file_is_there(document: Path) -> None:
    for file, name in sorted(named_in_files(document.read_text())):
        text = (ROOT / file).read_text()
        missing = [part for part in name.split(".") if not re.search(rf"\b{part}\b", text)]
        assert missing == [], f"{document.name}: {file} has no {name}"


@pytest.mark.parametrize("document", [*DOCUMENTS, ROOT / "README.md"], ids=lambda path: path.stem)
def test_a_document_uses_no_word_that_only_this_project_knows(document: Path) -> None:
    text = re.sub(r"`[^`]*`|^    .*$", "", document.read_text(), flags=re.MULTILINE)
    if document.stem != "glossary":  # which defines those that are left
        assert re.findall(r"(?i)\b(?:fore)?t(?:old|ells?)\b|\bplain(?:ly)?\b|\bsurely\b|\bquiet(?:ly)?\b", text) == []


@pytest.mark.parametrize("document", [*DOCUMENTS, ROOT / "CONTRIBUTING.md"], ids=lambda path: path.stem)
def test_every_file_of_the_source_that_a_document_names_exists(document: Path) -> None:
    folders = (
        "collision_monitor",
        "collision_monitor_msgs",
        "benchmarks",
        "docs",
        "scripts",
        "test",
        "config",
        "launch",
    )
    files = {f"/{path.relative_to(ROOT)}" for folder in folders for path in (ROOT / folder).rglob("*.*")}
    named = re.findall(r"`(?:python )?([\w/.]+\.(?:py|sh|msg|txt|xml|rviz|mjs))`", document.read_text())
    missing = {name for name in named if "NEW" not in name and not any(each.endswith(f"/{name}") for each in files)}
    assert missing - {"setup.py", "package.xml", "cli/NAME.py"} == set()


def test_names_of_files_are_found_in_documents() -> None:
    text = "see `a` and `B.c` in [x](../collision_monitor/x.py), `LIMIT` in `y/z.py`, or `word` in the file"
    x, z = "collision_monitor/x.py", "collision_monitor/y/z.py"
    assert named_in_files(text) == {(x, "a"), (x, "B.c"), (z, "LIMIT")}
    assert sum(len(named_in_files(path.read_text())) for path in DOCUMENTS) >= 20
