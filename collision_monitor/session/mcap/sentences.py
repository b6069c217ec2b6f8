"""A list of sentences about a file, such as its damage, that stays short whatever is in the file."""

from __future__ import annotations

from typing import Final

LIMIT: Final = 1000
"""Sentences that are kept: a person reads the first ones, and memory must not grow with the damage."""

MORE: Final = "more damage follows, which is not listed"


def add_sentence(sentences: list[str], text: str) -> None:
    """Append a sentence; behind the first LIMIT ones only state that there is more."""
    if len(sentences) < LIMIT:
        sentences.append(text)
    elif len(sentences) == LIMIT:
        sentences.append(MORE)
