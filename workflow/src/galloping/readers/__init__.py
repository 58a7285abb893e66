"""Readers of instrument files: from tables with names and units to recordings of states."""

MAX_LISTED_NAMES = 12  # names listed in a message


class FileError(ValueError):
    """Error raised for a file that cannot be used, with a message of one line."""
