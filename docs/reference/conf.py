"""How Sphinx builds the reference of the Python API from the docstrings: `make docs`.

The pages load nothing from other machines: the theme brings its styles, and no extension fetches anything.
"""

from __future__ import annotations

import re
from dataclasses import fields
from types import ModuleType
from typing import Any

import collision_monitor as cm
from collision_monitor import session, sources
from collision_monitor.shapes.registry import KINDS

project = "collision_monitor"
author = "The collision_monitor maintainers"
release = version = cm.__version__
extensions = ["sphinx.ext.autodoc"]
html_theme = "alabaster"
html_theme_options = {
    "description": "Reference of the Python API",
    "fixed_sidebar": True,
    "font_family": "sans-serif",
    "page_width": "1100px",
}
html_copy_source = False
html_show_sphinx = False

default_role = "py:obj"  # `contact` in a docstring is a link if the reference has that name
add_module_names = False
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_typehints_format = "short"
autodoc_type_aliases = {name: name for name in ("ArrayLike", "Array", "Compound")}
autodoc_default_options = {
    "inherited-members": "tuple, int, IntEnum, Enum, Exception, BaseException, Warning, UserWarning, object",
}
autodoc_class_signature = "mixed"
autoclass_content = "both"
maximum_signature_line_length = 100

PUBLIC: tuple[ModuleType, ...] = (cm, cm.response, cm.world, session, sources)
TWO_HUMPS = "|".join(name for name in cm.__all__ if re.fullmatch(r"([A-Z][a-z]+){2,}", name))


def _move_to_public_modules() -> None:
    """Give each object the module from which users import it, so that the types in signatures are links."""
    for module in PUBLIC:
        for name in module.__all__:
            found = getattr(module, name)
            if callable(found) and getattr(found, "__module__", "").startswith("collision_monitor."):
                found.__module__ = module.__name__


def _with_shapes(app: Any, page: str, source: list[str]) -> None:
    """Put an entry for each kind of shape in place of {shapes}, so that a new kind is in the reference by itself."""
    entries = []
    for shape in (kind.shape for kind in KINDS):
        names = ", ".join(field.name for field in fields(shape))
        given = f"({names})" if "__new__" in vars(shape) else ""  # which takes any arguments, to refuse wrong ones
        entries.append(f".. autoclass:: {shape.__name__}{given}\n   :members:\n")
    source[0] = source[0].replace("{shapes}", "\n".join(entries))


def _marked_up(line: str) -> str:
    """Escape what reads as markup outside of `names`, and let names such as ShapeError be links."""
    parts = re.split(r"(`[^`]*`)", line)
    for k in range(0, len(parts), 2):
        parts[k] = re.sub(r"([*|_])", r"\\\1", parts[k])
        parts[k] = re.sub(rf"\b({TWO_HUMPS})\b(?![(.])", r"`\1`", parts[k])
    return "".join(parts)


def _is_of_tuple(app: Any, what: str, name: str, member: Any, skip: bool, options: Any) -> bool | None:
    """Leave out what every named tuple has; its fields are in the signature and in the docstring."""
    return True if str(member.__doc__).startswith("Alias for field number") else None


def _as_restructured_text(app: Any, what: str, name: str, of: Any, options: Any, lines: list[str]) -> None:
    """Turn a docstring, which is text with `names`, examples and indented tables, into reStructuredText."""
    if lines[-2:] and any(line.startswith("Create new instance of") for line in lines):
        del lines[next(k for k, line in enumerate(lines) if line.startswith("Create new instance of")) :]
    found: list[str] = []
    example = table = False
    for line in lines:
        example = bool(line) and (example or line.lstrip().startswith(">>>"))
        if line.startswith("    ") and not example and not table and (not found or not found[-1]):
            table = True
            found += ["::", ""]
        elif line and not line.startswith("    "):
            table = False
        found.append(line if example or table else _marked_up(line))
    lines[:] = found


def setup(app: Any) -> None:
    """Prepare the objects and connect the translation of docstrings."""
    _move_to_public_modules()
    app.connect("source-read", _with_shapes)
    app.connect("autodoc-skip-member", _is_of_tuple)
    app.connect("autodoc-process-docstring", _as_restructured_text)
