"""What the answers depend on besides the inputs and the profile. A replay compares it first."""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from types import CodeType
from typing import Final

import llvmlite.binding
import numba
import numpy

from collision_monitor._jit.imports import source_file, with_dependencies
from collision_monitor._version import VERSION

_ROOT: Final = "collision_monitor.pipeline.pipeline"
"""The module that computes answers from inputs. Modules that it does not import, even indirectly, have no effect."""


@cache
def provenance() -> dict[str, str]:
    """Return versions, processor and `determinism_key`. If two keys are equal, equal inputs give equal bytes."""
    facts = {
        "version": VERSION,
        "python": platform.python_version(),
        "numpy": numpy.__version__,
        "numba": numba.__version__,
        "machine": platform.machine(),
        "cpu": llvmlite.binding.get_host_cpu_name(),
    }
    digest = hashlib.blake2b("\n".join(facts.values()).encode(), digest_size=16)
    for module in with_dependencies(_ROOT):
        path = source_file(module)
        if path is not None:
            digest.update(f"\n{module} {_code(path.read_bytes())}".encode())
    return {**facts, "determinism_key": digest.hexdigest()}


def _code(source: bytes) -> str:
    """Return what a source file does: its bytecode, without comments, docstrings and line numbers.

    Compiling takes a third of the time of `ast.dump`. Results are comparable within one version of Python.
    """
    return _describe(compile(source, "", "exec", dont_inherit=True, optimize=2))


def _describe(code: CodeType) -> str:
    names = code.co_name, code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    arguments = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags
    constants = [_constant(each) for each in code.co_consts if not _is_line_number(each, code)]
    return f"{names} {arguments} {code.co_code!r} {code.co_exceptiontable!r} {constants}"


def _constant(value: object) -> str:
    if isinstance(value, CodeType):
        return _describe(value)
    if isinstance(value, frozenset):  # its order differs from process to process
        return f"frozenset {sorted(map(repr, value))}"
    return repr(value)


def _is_line_number(value: object, code: CodeType) -> bool:
    """Return whether it is the line number of a class, which Python 3.13 stores in the body of the class."""
    return "__firstlineno__" in code.co_names and value == code.co_firstlineno
