"""Readers of instrument files: from tables with names and units to recordings of states."""


class FileError(ValueError):
    """Error of a file that cannot be used as it is; one line."""
