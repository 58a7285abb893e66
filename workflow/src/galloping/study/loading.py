"""What a job reads, by name, as `sources` describes it."""

from __future__ import annotations

from collections.abc import Mapping

from galloping.importing import imported


def load(readers: Mapping, paths: Mapping[str, str]) -> dict:
    """What the files hold, by name or by name and key.

    readers: as of `sources.readers`. paths: by name, as of `sources.flat`.
    """
    return {
        name: imported(reader)(paths[name])
        if isinstance(reader, str)
        else {key: imported(each)(paths[f"{name}/{key}"]) for key, each in reader.items()}
        for name, reader in readers.items()
    }
