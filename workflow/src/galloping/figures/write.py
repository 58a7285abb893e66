"""Writes a figure as SVG and PNG: whole or not at all, the same bytes for the same figure."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

from matplotlib.figure import Figure

from galloping.figures.style import styled
from galloping.storage import replacing

# without the date and the version of the library
METADATA = {"svg": {"Date": None, "Creator": None}, "png": {"Software": None}}

DIGITS = re.compile(r"(\d\.\d)\d+")  # of coordinates: all beyond a tenth of a point is cut
BLANKS = re.compile(r"(?<=\d)\s+([LCQz])|(?<=[MLCQ]) ")  # around the commands of a path


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
                if form == "svg":
                    _shorten(Path(partial))
            figure.set_layout_engine(None)  # solved once, kept for the second file


def _shorten(svg: Path) -> None:
    """Paths of an SVG without needless blanks, to a tenth of a point (720 dpi), in place."""
    text = re.sub(r"\n +(?=<)", "\n", svg.read_text(encoding="utf-8"))
    svg.write_text(re.sub(r' d="[^"]*"', _shortened, text), encoding="utf-8")


def _shortened(path: re.Match) -> str:
    return BLANKS.sub(r"\1", DIGITS.sub(r"\1", path[0]))
