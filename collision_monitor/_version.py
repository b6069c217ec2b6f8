"""The version, in one place: pyproject.toml, the status message and recordings read it here."""

from typing import Final

VERSION: Final = "0.1.0"
