"""`collision-monitor warm-up`: compile the kernels in advance, for an image or before a robot starts."""

from __future__ import annotations

import argparse
import time
from typing import Final

from collision_monitor.cli.options.usage import UsageError
from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.cli.output.progress import progress_anywhere
from collision_monitor.errors import InputError

PARTS: Final = ("monitor", "options", "functions")

DESCRIPTION = """\
Compile the kernels in advance, once for this machine and version, so that no start waits for the
compiler. A container image or an installation in /opt runs it while it is built.

The kernels go to NUMBA_CACHE_DIR, or to the first of these folders that can be written to: var/cache in the
virtual environment (/var/cache without one), the user's cache, a temporary folder. They are read
from all of them, also where they cannot be written. NUMBA_CPU_NAME, such as x86-64-v3, with an empty
NUMBA_CPU_FEATURES compiles for other processors than this one; set both when they run, too.
"""
EPILOG = """\
examples:
  collision-monitor warm-up
  collision-monitor warm-up monitor                             a node's steps with plain settings
  NUMBA_CPU_NAME=x86-64-v3 NUMBA_CPU_FEATURES= collision-monitor warm-up     for several kinds of processors

exit codes:
  0  done
  1  no folder can be written to
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "warm-up",
        help="compile the kernels in advance",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "parts", nargs="*", metavar="PART",
        help=f"{', '.join(PARTS)} (default: all): a monitor's steps; uncertain states, budgets and contacts of many "
        "points; the functions for two shapes",
    )  # fmt: skip
    parser.set_defaults(command=warm_up_command)


def warm_up_command(args: argparse.Namespace) -> int:
    """Run the command and return the exit code. Raises UsageError; InputError if the kernels cannot be kept."""
    from collision_monitor import warm_up
    from collision_monitor._jit.compilation import FUNCTIONS, CompilationProgress, listening
    from collision_monitor._jit.places import is_trusted, kernel_places

    if unknown := [part for part in args.parts if part not in PARTS]:
        raise UsageError(f"expected parts of {', '.join(PARTS)}, got {unknown[0]!r}")
    compiled, began = 0, time.monotonic()
    for part in args.parts or PARTS:
        with progress_anywhere(f"compiling: {part}", FUNCTIONS[part]) as advance:

            def count(advance: object = advance) -> None:
                nonlocal compiled
                compiled += 1
                advance(1)  # type: ignore[operator]

            with listening(CompilationProgress(FUNCTIONS[part], count)):
                warm_up.PARTS[part]()
    kept = next((place for place in kernel_places() if is_trusted(place)), None)
    if kept is None:
        tried = ", ".join(map(str, kernel_places()))
        raise InputError(f"expected a folder that can be written to, of {tried}; set NUMBA_CACHE_DIR to one")
    print(f"{compiled} functions compiled in {time.monotonic() - began:.0f} s; the kernels are in {kept}")
    return ExitCode.DONE
