"""XML as a tree of elements that know their lines, read within limits, for URDF and SRDF."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.tolerances import LARGEST_INPUT

LARGEST_TEXT: Final = 16 << 20
"""Characters of a file. The URDF of a humanoid with 100 links has 0.2 MB."""

MOST_ELEMENTS: Final = 200_000
DEEPEST: Final = 50


@dataclass(eq=False)
class Element:
    """An XML element. where: `FILE, line N`, for the texts of errors. content: the text in it, if it was read."""

    tag: str
    attributes: dict[str, str]
    where: str
    children: list[Element] = field(default_factory=list)
    content: str = ""

    def all(self, tag: str) -> Iterator[Element]:
        """Yield the children with this tag."""
        return (child for child in self.children if child.tag == tag)

    def first(self, tag: str) -> Element | None:
        """Return the first child with this tag; None if there is none."""
        return next(self.all(tag), None)

    def error(self, text: str) -> InputError:
        """Return the error for this element, to be raised."""
        name = self.attributes.get("name")
        return InputError(f"{self.where}, <{self.tag}{f' name={name!r:.80}' if name else ''}>: {text}")

    def text(self, key: str) -> str:
        """Return an attribute that is not empty. Raises InputError."""
        value = self.attributes.get(key, "").strip()
        if not value:
            if key in self.attributes:
                raise self.error(f"{key}: expected a value, got an empty text")
            raise self.error(f"expected an attribute {key}, got {', '.join(self.attributes) or 'no attribute':.200}")
        return value

    def number(self, key: str, default: float | None = None) -> float:
        """Return an attribute that is a finite number. Raises InputError."""
        if default is not None and key not in self.attributes:
            return default
        return float(self.vector(key, 1)[0])

    def vector(self, key: str, count: int, default: Any = None) -> NDArray[np.float64]:
        """Return an attribute of `count` finite numbers with spaces between them. Raises InputError."""
        if default is not None and key not in self.attributes:
            return np.array(default, np.float64)
        value = self.text(key)
        try:
            if "_" in value or not value.isascii():  # which only Python reads
                raise ValueError
            numbers = np.array([float(word) for word in value.split()])
        except ValueError:
            numbers = np.zeros(0)
        if numbers.shape != (count,) or not (np.abs(numbers) <= LARGEST_INPUT).all():
            expected = "a finite number" if count == 1 else f"{count} finite numbers"
            raise self.error(f"{key}: expected {expected}, got {value!r:.80}")
        return numbers


def parse_xml(text: str | bytes, name: str, *, largest: int = LARGEST_TEXT, contents: bool = False) -> Element:
    """Return the root element of an XML text. name: of its file, for errors. Raises InputError.

    largest: characters. contents: whether the texts in the elements are read too, which URDF has none of.

    A document type, and with it every entity of its own, is refused: a few lines of entities expand to gigabytes.
    """
    if len(text) > largest:
        raise InputError(f"{name}: expected XML of at most {largest} characters, got {len(text)}")
    builder = _Builder(name, contents)
    try:
        builder.parser.Parse(text, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        raise InputError(f"{name}, line {error.lineno}: expected XML, got: {reason}") from None
    except InputError:
        raise
    except (UnicodeError, ValueError) as error:
        raise InputError(f"{name}: expected XML, got: {error!s:.200}") from None
    return builder.root.children[0]


class _Builder:
    def __init__(self, name: str, contents: bool) -> None:
        self.root = Element("", {}, name)
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.StartDoctypeDeclHandler = self._refuse_document_type
        if contents:
            self.parser.buffer_text = True
            self.parser.CharacterDataHandler = self._add
        self._name = name
        self._texts: list[list[str]] = [[]]
        self._open = [self.root]
        self._count = 0

    def _where(self) -> str:
        return f"{self._name}, line {self.parser.CurrentLineNumber}"

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._count += 1
        if self._count > MOST_ELEMENTS or len(self._open) > DEEPEST:
            limits = f"at most {MOST_ELEMENTS} elements and {DEEPEST} levels"
            raise InputError(f"{self._where()}: expected {limits} of XML, got more")
        element = Element(tag, attributes, self._where())
        self._open[-1].children.append(element)
        self._open.append(element)
        self._texts.append([])

    def _end(self, tag: str) -> None:
        self._open.pop().content = "".join(self._texts.pop())

    def _add(self, text: str) -> None:
        self._texts[-1].append(text)

    def _refuse_document_type(self, *_: Any) -> None:
        raise InputError(f"{self._where()}: expected XML without a document type, got <!DOCTYPE …>")
