"""Readers of instrument files: from tables with names and units to recordings of states."""

from collections.abc import Sequence

SHOWN = 12  # names in a message


class FileError(ValueError):
    """Error raised for a file that cannot be used, with a message of one line."""


def enumerated(parts: Sequence[str]) -> str:
    """Join the first twelve texts by commas, and state how many more there are."""
    more = f" and {len(parts) - SHOWN} more" if len(parts) > SHOWN else ""
    return ", ".join(parts[:SHOWN]) + more
