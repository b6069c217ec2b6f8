"""Wrong usage, exit code 2: what the arguments, or a file of settings that they name, cannot mean.

Sessions that cannot be read and files that cannot be written are errors, exit code 1.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from collision_monitor.errors import InputError

if TYPE_CHECKING:
    from collision_monitor.alerts.rules import Rules


class UsageError(InputError):
    """The arguments contradict each other, or name a profile, a scene or a setting that does not exist."""


@contextmanager
def usage() -> Iterator[None]:
    """Raise UsageError in place of the InputError of an argument."""
    try:
        yield
    except InputError as error:
        raise UsageError(str(error)) from None


def check_unused(args: Namespace, options: Iterable[str], why: str) -> None:
    """Raise UsageError for an option that was given and would be ignored. why: for the user; names as in `args`."""
    for name in options:
        value = getattr(args, name)
        if value is not None:
            raise UsageError(f"--{name.replace('_', '-')}: {why}; leave it out (got {value})")


def given_rules(file: str) -> Rules:
    """Return the rules of alerts in a file. Raises UsageError if it cannot be used or has none."""
    from collision_monitor.alerts.rules import Rules

    with usage():
        rules = Rules.given(file)
    if not rules.rules:
        raise UsageError(f"--rules: expected at least one rule in {file}, got none; leave the option out")
    return rules


def check_profiles(names: Iterable[str]) -> None:
    """Raise UsageError for a profile that does not exist or cannot be used. Empty: the one of a session."""
    from collision_monitor.settings.profile import Profile

    with usage():
        for name in filter(None, names):
            Profile.named(name)
