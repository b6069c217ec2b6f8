"""The figures of the source by which its order is judged: folders, namesakes, long functions, long files.

    python scripts/house.py             # prints the figures
    python scripts/house.py --lists     # and the names, functions and files behind each figure

Standard library only. `test/test_house.py` holds the bounds.
"""

from __future__ import annotations

import argparse
import ast
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[1]
PACKAGE: Final = ROOT / "collision_monitor"
MONITOR: Final = PACKAGE / "monitor" / "monitor.py"

LONGEST_FUNCTION: Final = 60
"""Lines of a function, from `def` to its last line."""

LONGEST_NAMES: Final = 200
"""Characters of a string that may hold names of definitions, such as a line of a table. Longer ones are prose."""

USERS: Final = (
    "scripts/**/*.py",
    "benchmarks/*",
    "examples/**/*.py",
    "launch/*.py",
    "docs/*",
    "README.md",
    "*.toml",
    "*.py",
)
"""What uses the package, besides itself and its tests."""

Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


@dataclass(frozen=True)
class Module:
    """One source file of the package. path: relative to the folder above the package."""

    path: str
    text: str
    tree: ast.Module

    @property
    def lines(self) -> int:
        """Number of lines."""
        return len(self.text.splitlines())


@dataclass(frozen=True, order=True)
class LongFunction:
    """A function with more lines than LONGEST_FUNCTION."""

    lines: int
    path: str
    name: str


def modules(package: Path = PACKAGE) -> list[Module]:
    """Read every source file of the package, in order of the paths."""
    found = []
    for path in sorted(package.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        found.append(Module(path.relative_to(package.parent).as_posix(), text, ast.parse(text)))
    return found


def texts_of_users() -> list[str]:
    """Read what uses the package: scripts, benchmarks, examples, documents and the metadata of the installation."""
    paths = sorted({path for pattern in USERS for path in ROOT.glob(pattern) if path.is_file()})
    return [path.read_text(encoding="utf-8") for path in paths if path.suffix in (".py", ".md", ".toml")]


def modules_by_folder(package: list[Module]) -> dict[str, int]:
    """Count the modules of each folder, without `__init__` and without its inner folders; the largest first."""
    counts: dict[str, int] = defaultdict(int)
    for each in package:
        folder, _, name = each.path.rpartition("/")
        counts[folder] += name != "__init__.py"
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))


def naming(package: list[Module], word: str) -> list[str]:
    """Return the paths of the files in which `word` stands, also in capitals, as a constant has it."""
    pattern = re.compile(rf"\b({word}|{word.upper()})\b")
    return [each.path for each in package if pattern.search(each.text)]


def namesakes(package: list[Module]) -> dict[str, list[str]]:
    """Return the public functions and classes that two or more modules define, with the paths of those modules."""
    homes: dict[str, list[str]] = defaultdict(list)
    for each in package:
        for name in dict.fromkeys(node.name for node in _definitions(each.tree.body)):
            if not name.startswith("_"):
                homes[name].append(each.path)
    return {name: paths for name, paths in sorted(homes.items()) if len(paths) > 1}


def _definitions(body: list[ast.stmt]) -> Iterator[Definition]:
    """Return the definitions at the level of the module, also under `if` and `try`."""
    for node in body:
        if isinstance(node, Definition):
            yield node
        elif isinstance(node, ast.If | ast.Try):
            for inner in (node.body, node.orelse, *(each.body for each in getattr(node, "handlers", ()))):
                yield from _definitions(inner)


def unused(package: list[Module], outside: Iterable[str] = ()) -> list[str]:
    """Return what the package defines and neither it nor the texts `outside` name: only tests use it, or nothing does.

    Of classes that inherit from other packages only the class counts, because those packages call their methods.
    """
    named = {word for text in outside for word in re.findall(r"\w+", text)}
    for each in package:
        named.update(*map(_words, ast.walk(each.tree)))
    own = {node.name for each in package for node in ast.walk(each.tree) if isinstance(node, ast.ClassDef)}
    return [
        f"{each.path} {name}"
        for each in package
        for name in _defined(each.tree.body, own)
        if name not in named and not name.startswith("__")
    ]


def _words(node: ast.AST) -> list[str]:
    """Return the words by which a node may refer to a definition. A word of a string may be looked up as a name."""
    match node:
        case ast.Name(id=name, ctx=ast.Load()) | ast.Attribute(attr=name) | ast.alias(name=name):
            return [name]
        case ast.Constant(value=str(text)) if len(text) < LONGEST_NAMES:
            return re.findall(r"\w+", text)
    return []


def _defined(body: list[ast.stmt], own: set[str]) -> Iterator[str]:
    """Return the names that a body defines: functions, classes, their methods and properties, and constants."""
    for node in body:
        match node:
            case ast.FunctionDef() | ast.AsyncFunctionDef():
                yield node.name
            case ast.ClassDef(bases=bases):
                yield node.name
                if all(getattr(base, "id", "") in own for base in bases):
                    methods = [each for each in node.body if isinstance(each, ast.FunctionDef)]
                    yield from (each.name for each in methods)
            case ast.Assign(targets=targets):
                yield from (name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name))
            case ast.AnnAssign(target=ast.Name(id=name)):
                yield name


def long_functions(package: list[Module]) -> list[LongFunction]:
    """Return the functions and methods with more than LONGEST_FUNCTION lines, the longest first."""
    found = []
    for each in package:
        for node in ast.walk(each.tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                lines = (node.end_lineno or node.lineno) - node.lineno + 1
                if lines > LONGEST_FUNCTION:
                    found.append(LongFunction(lines, each.path, node.name))
    return sorted(found, reverse=True)


def long_files(package: list[Module], most: int) -> dict[str, int]:
    """Return the files with more than `most` lines, the longest first."""
    counts = {each.path: each.lines for each in package if each.lines > most}
    return dict(sorted(counts.items(), key=lambda item: -item[1]))


def class_lines(path: Path, name: str) -> int:
    """Return the number of lines of a class."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ClassDef) and node.name == name:
            return (node.end_lineno or node.lineno) - node.lineno + 1
    raise LookupError(f"{path}: expected a class {name}")


def figures(package: list[Module]) -> list[tuple[str, str, list[str]]]:
    """Return each figure: its name, its value, and the lines of what stands behind it."""
    folders, shared, long = modules_by_folder(package), namesakes(package), long_functions(package)
    cones, idle = naming(package, "Cone"), unused(package, texts_of_users())
    largest = next(iter(folders))
    lines = sum(each.lines for each in package)
    words = len((ROOT / "README.md").read_text(encoding="utf-8").split())
    return [
        ("files of the package", f"{len(package):,}", []),
        ("lines of the package", f"{lines:,}", [f"{n:5} {path}" for path, n in long_files(package, 300).items()]),
        ("folders", f"{len(folders)}", []),
        ("modules of the largest folder", f"{folders[largest]} ({largest})",
         [f"{n:5} {folder}" for folder, n in folders.items()]),
        ("files that name Cone", f"{len(cones)}", cones),
        ("public names of two or more modules", f"{len(shared)}",
         [f"{name}: {', '.join(paths)}" for name, paths in shared.items()]),
        (f"functions of more than {LONGEST_FUNCTION} lines", f"{len(long)}",
         [f"{each.lines:5} {each.path} {each.name}" for each in long]),
        ("definitions that only tests use", f"{len(idle)}", idle),
        ("lines of the class Monitor", f"{class_lines(MONITOR, 'Monitor')}", []),
        ("lines of monitor/monitor.py", f"{len(MONITOR.read_text(encoding='utf-8').splitlines())}", []),
        ("words of README", f"{words:,}", []),
    ]  # fmt: skip


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--lists", action="store_true", help="print what stands behind each figure too")
    with_lists = parser.parse_args().lists
    for name, value, lines in figures(modules()):
        print(f"{name:38} {value}")
        for line in lines if with_lists else ():
            print(f"    {line}")


if __name__ == "__main__":
    main()
