"""Writes a figure as SVG and PNG: whole or not at all, the same bytes for the same figure."""

from __future__ import annotations

import os
from collections.abc import Callable

from matplotlib.figure import Figure

from galloping.figures.style import styled
from galloping.storage import replacing

# without the date and the version of the library
METADATA = {"svg": {"Date": None, "Creator": None}, "png": {"Software": None}}


def write_figure(
    svg: str | os.PathLike,
    png: str | os.PathLike,
    draw: Callable[[], Figure],
    dpi: float,
    font_size: float,
) -> None:
    """What `draw` returns, drawn and written in the project's style."""
    with styled(font_size):
        figure = draw()
        for path, form in ((svg, "svg"), (png, "png")):
            with replacing(path) as partial:
                figure.savefig(partial, format=form, dpi=dpi, metadata=METADATA[form])
            figure.set_layout_engine(None)  # solved once, kept for the second file
