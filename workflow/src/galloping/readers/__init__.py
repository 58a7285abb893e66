"""Readers of files of instruments: from tables with names and units to recordings of states."""


class FileError(ValueError):
    """A file that cannot be used as it is; one line."""
