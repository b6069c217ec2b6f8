"""Reads the YAML that a user or a file gives, within limits: a few bytes of YAML can stand for gigabytes.

Aliases are the worst of it: ten lines of lists of aliases of lists expand to 10^9 elements. No file of ours needs them.
The metadata of rosbag2 may hold some, because PyYAML writes them for equal lists; there the expanded size counts.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import yaml

from collision_monitor.errors import InputError
from collision_monitor.settings.regular_file import read_regular

if TYPE_CHECKING:
    from yaml import SafeLoader
else:
    SafeLoader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml reads 20 times as fast

Keys = tuple[str | int, ...]
"""Keys and indices that lead to a value."""

LARGEST: Final = 1 << 20
"""Bytes of a file. A mapping with 1,000 objects has 0.1 MB."""

DEEPEST: Final = 50
"""Levels of nesting. The deepest file in use, the metadata of rosbag2, has 8."""

NODES: Final = 100_000
"""Scalars, lists and tables of a file, with those that aliases repeat. A mapping with 1,000 objects has 15,000."""

_LONGEST: Final = 100
"""Characters of a number or a date: Python takes quadratic time for longer ones."""

_EXPONENT: Final = re.compile(r"[-+]?(?:[0-9]+\.?|[0-9]*\.[0-9]+)[eE][-+]?[0-9]{1,3}$")
"""Numbers such as 1e-4, as YAML 1.2 and our own messages write them: YAML 1.1 wants 1.0e-4. No float needs more digits
of the exponent."""

_SHOWN: Final = 200
"""Characters of the library's reason that an error repeats."""


def read_yaml(path: Path, *, aliases: bool = False, nodes: int = NODES) -> Any:
    """Return the content of a YAML file of plain values. aliases: allow them.

    Raises InputError with the file and the line.
    """
    return parse_yaml(read_text(path), str(path), aliases=aliases, nodes=nodes)


def read_text(path: Path, most: int = LARGEST) -> str:
    """Return the text of a YAML file. most: bytes. Raises InputError."""
    data = read_regular(path, "a YAML file", most=most)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(f"{path}, line {line}: expected YAML in UTF-8, got bytes that are not") from None


def parse_yaml(text: str, name: str, *, aliases: bool = False, nodes: int = NODES) -> Any:
    """Return the content of YAML text. name: of its file, for errors. Raises InputError with it and the line."""
    try:
        if len(text) > LARGEST:
            raise _refused(f"expected at most {LARGEST} characters", f"{len(text)}", None)
        _check(text, aliases, nodes)
        return yaml.load(text, _Loader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{name}, line {mark.line + 1}" if mark else name
        reason = getattr(error, "problem", None) or getattr(error, "reason", None) or str(error)
        raise InputError(f"{where}: expected YAML, got: {' '.join(str(reason).split())[:_SHOWN]}") from None
    except Exception as error:  # the library raises many kinds of errors for tags that do not fit their values
        raise InputError(f"{name}: expected YAML, got a value that does not fit its tag: {error!r:.{_SHOWN}}") from None


def value_lines(text: str) -> dict[Keys, int]:
    """Return the line of each key and of each element of a list, in a text that `parse_yaml` accepted."""
    found: dict[Keys, int] = {}
    waiting: list[tuple[Keys, Any]] = [((), yaml.compose(text, SafeLoader))]
    while waiting:
        path, node = waiting.pop()
        if isinstance(node, yaml.MappingNode):
            for key, value in node.value:
                if isinstance(key, yaml.ScalarNode):
                    found[*path, key.value] = key.start_mark.line + 1
                    waiting.append(((*path, key.value), value))
        elif isinstance(node, yaml.SequenceNode):
            for k, value in enumerate(node.value):
                found[*path, k] = value.start_mark.line + 1
                waiting.append(((*path, k), value))
    return found


def key_lines(path: Path) -> dict[str, int]:
    """Return the line of each key in the first three levels of a file that `read_yaml` accepted.

    Keys of the first two levels are by their names, and those of the third by `second, third`. Of equal names, the last
    counts.
    """
    found: dict[str, int] = {}
    for keys, line in sorted(value_lines(read_text(path)).items(), key=lambda each: each[1]):
        names = [key for key in keys if isinstance(key, str)]
        if len(names) == len(keys) <= 3:
            found[", ".join(names[-2:]) if len(names) == 3 else names[-1]] = line
    return found


def _refused(expected: str, found: str, mark: Any) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(None, None, f"{found} ({expected})", mark)


def _events(text: str) -> Iterator[yaml.Event]:
    """Parse text. PyYAML from 6.0.4 on has a limit of the nesting of its own, which is reached first by some texts."""
    try:
        yield from yaml.parse(text, SafeLoader)
    except yaml.MarkedYAMLError as error:
        if "nesting depth" not in str(error.problem):
            raise
        raise _refused(f"at most {DEEPEST} levels", "deeper nesting", error.problem_mark) from None


def _check(text: str, aliases: bool, limit: int) -> None:
    """Compare depth, number of nodes and use of aliases with the limits, before anything is built. Raises YAMLError."""
    total = 0
    sizes: dict[str | None, int] = {}  # nodes of each anchor, expanded
    open_nodes: list[tuple[str | None, int]] = []  # anchor, and the total before it
    for event in _events(text):
        if isinstance(event, yaml.CollectionEndEvent):
            anchor, before = open_nodes.pop()
            if anchor is not None:
                sizes[anchor] = total - before
            continue
        if not isinstance(event, yaml.NodeEvent):
            continue
        if isinstance(event, yaml.AliasEvent):
            if not aliases:
                raise _refused("write the value out instead", f"the alias *{event.anchor:.40}", event.start_mark)
            if event.anchor in (anchor for anchor, _ in open_nodes):
                raise _refused("a value without itself", f"*{event.anchor:.40} within itself", event.start_mark)
            total += sizes.get(event.anchor, 1)
        else:
            if isinstance(event, yaml.CollectionStartEvent):
                open_nodes.append((event.anchor, total))
            elif event.anchor is not None:
                sizes[event.anchor] = 1
            total += 1
        if len(open_nodes) > DEEPEST:
            raise _refused(f"at most {DEEPEST} levels", "deeper nesting", event.start_mark)
        if total > limit:
            raise _refused(f"at most {limit}", "more values", event.start_mark)


class _Loader(SafeLoader):
    """Refuses a duplicate key. YAML would ignore the first one, and an expectation or an object would be lost."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value if isinstance(node, yaml.MappingNode) else ():
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    raise yaml.constructor.ConstructorError(
                        None, None, f"the same key twice: {key.value!r:.80}", key.start_mark
                    )
                seen.add(key.value)
        return super().construct_mapping(node, deep)


def _bounded(construct: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Return a constructor that refuses long scalars, and those that look like a number or date and are none."""

    def bounded(loader: Any, node: yaml.Node) -> Any:
        if len(node.value) > _LONGEST:
            raise _refused(f"at most {_LONGEST} characters", "a longer number", node.start_mark)
        try:
            return construct(loader, node)
        except (ValueError, ArithmeticError, AttributeError) as error:
            raise _refused("put a text in quotes", f"{node.value!r:.40}: {error}", node.start_mark) from None

    return bounded


for _kind in ("int", "float", "timestamp"):
    _Loader.add_constructor(f"tag:yaml.org,2002:{_kind}", _bounded(getattr(SafeLoader, f"construct_yaml_{_kind}")))
_Loader.add_implicit_resolver("tag:yaml.org,2002:float", _EXPONENT, list("-+.0123456789"))
