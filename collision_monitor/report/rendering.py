"""Style of the figures, and their conversion to SVG and PNG for light and dark, broad and narrow pages."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from threading import RLock
from typing import Any, Final

import matplotlib as mpl
from matplotlib.figure import Figure

CONTACT, WARNING, POSSIBLE = "#d1493f", "#e0912a", "#8a8a8a"
PALETTE: Final = ("#3b82c4", "#d1493f", "#2e9e5b", "#9b5fc0", "#e0912a", "#1a9fa8")

INK: Final = "#010101"
"""Colour of text and of lines that are not data. In SVG it becomes the text colour of the page, light or dark."""

STYLE: Final[Any] = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "legend.fontsize": 9,
    "legend.handlelength": 1.2,
    "svg.fonttype": "none",  # text, so that the browser's fonts draw the letters of any script
    "svg.hashsalt": "collision_monitor",
    "text.parse_math": False,  # a name may contain a dollar sign
    **dict.fromkeys(("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"), INK),
}


_STYLED: Final = RLock()
"""Held while Matplotlib's settings, which belong to the whole process, are those of the report."""


@dataclass(frozen=True)
class Size:
    """Size of a page: its name, the width of a figure (inches), and the number of panels side by side."""

    name: str
    width: float
    columns: int

    @property
    def narrow(self) -> bool:
        """Whether the page is as narrow as a phone."""
        return self.columns == 1


BROAD: Final = Size("broad", 7.6, 3)
NARROW: Final = Size("narrow", 3.9, 1)

_WITHOUT_METADATA: Final[Any] = dict.fromkeys(("Date", "Creator", "Format", "Type"))


def as_svg(figure: Figure, name: str) -> str:
    """Return the figure as an SVG element for HTML. Equal figures give equal bytes.

    name: of the figure, unique on the page. It prefixes all ids, so that references stay within the figure.
    """
    text = _saved(figure, format="svg", metadata=_WITHOUT_METADATA, transparent=True).decode()
    text = text[text.index("<svg") :]
    text = re.sub(r'(\sid="|xlink:href="#|url\(#)', rf"\g<1>{name}-", text)
    text = re.sub(r'\sxmlns(:xlink)?="[^"]*"', "", text)  # HTML needs no namespace for SVG
    text = re.sub(r"(font: [^'\";]*?)'DejaVu Sans'[^\";]*", r"\1system-ui, sans-serif", text)
    text = re.sub(r"<!--.*?-->\s*", "", text, flags=re.DOTALL)
    text = text.replace("<svg ", f'<svg role="img" aria-label="{name}" ', 1)
    return text.replace("xlink:href=", "href=").replace(INK, "currentColor")


def as_png(figure: Figure) -> bytes:
    """Return the figure as PNG on a white background."""
    return _saved(figure, format="png", dpi=150, metadata={"Software": None})


@contextmanager
def styled() -> Iterator[None]:
    """Draw in the report's style within the block. One thread at a time, because the style is the whole process's."""
    with _STYLED, mpl.rc_context(STYLE):
        yield


def _saved(figure: Figure, **options: Any) -> bytes:
    buffer = BytesIO()
    with styled(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from font")  # for names in other scripts
        figure.savefig(buffer, **options)
    return buffer.getvalue()
