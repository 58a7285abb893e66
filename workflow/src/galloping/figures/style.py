"""Common style of all figures: sizes, fonts, appearance of methods, and reproducible files.

A figure is written whole or not at all, with the same bytes for the same figure.
"""

import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import matplotlib.style
from matplotlib.figure import Figure

from galloping.results import BOUND
from galloping.storage import replacing

SINGLE_COLUMN, DOUBLE_COLUMN = 3.5, 7.2  # inches: widths of one and two columns of a paper

TRUE_COLOR = "#9a9a9a"  # colour of the true motion, a broad line below the reconstructed motion
MODEL_COLOR = "#11115a"  # colour of identified models
BAND = "#f2c46d"
PAPER_COLOR = "#b30000"  # colour of numbers printed in the paper
SHADE = "#ececec"  # colour of shaded areas
LIGHT_GREY = "#e4e4e4"  # colour of lines between rows
DARK_GREY = "#5f5f5f"  # colour of side notes

# colours and markers of series that are not methods, such as noise levels
SERIES = (("#11115a", "o"), ("#1f78b4", "s"), ("#e69f00", "D"), ("#2fa86a", "P"), ("#8a1c3b", "X"))

STATE_LABELS = {"q_v": "$q_v$", "q_w": "$q_w$"}
DIRECTIONS = {"q_v": "vertical", "q_w": "horizontal"}

# options of savefig by format: no date and no version; low compression halves the time of a PNG
SAVE_OPTIONS: dict[str, dict[str, Any]] = {
    "svg": {"metadata": {"Date": None, "Creator": None}},
    "png": {"metadata": {"Software": None}, "pil_kwargs": {"compress_level": 3}},
}

STYLE_FILE = Path(__file__).with_name("figure.mplstyle")
SVG_PATHS = re.compile(r' d="[^"]*"')
SURPLUS_DIGITS = re.compile(r"(\d\.\d)\d+")  # digits of coordinates below a tenth of a point
SURPLUS_BLANKS = re.compile(r"(?<=\d)\s+([LCQz])|(?<=[MLCQ]) ")  # around the commands of a path


@dataclass(frozen=True)
class MethodStyle:
    """Style of an identification method in all figures: label, colour, marker and line.

    No two methods have the same colour, marker and line. marker: empty for a line alone. weight: of
    line and marker, relative to those of a usual method.
    """

    label: str
    color: str
    marker: str
    line: str | tuple
    weight: float = 1.0


METHOD_STYLES = {
    "stlsq": MethodStyle("STLSQ", "#11115a", "o", "-"),
    "paper": MethodStyle("paper's method", "#1f78b4", "s", "--"),
    "lasso": MethodStyle("LASSO", "#e69f00", "D", "-."),
    "frols": MethodStyle("FROLS", "#8c6d1f", "H", (0, (6, 1, 2, 1))),
    "oracle": MethodStyle("best possible tuning", "#3d3d3d", ".", (0, (1, 1)), 1.1),
    "ensemble": MethodStyle("ensemble", "#2fa86a", "P", ":"),
    "weak": MethodStyle("weak form", "#8a1c3b", "X", (0, (5, 1, 1, 1, 1, 1))),
    "weak_gls": MethodStyle("weak form, GLS", "#7b3fbf", "d", (0, (7, 2)), 1.3),
    "maximum_likelihood": MethodStyle("maximum likelihood", "#e6007e", "p", "-", 1.5),
    BOUND: MethodStyle("Cramér-Rao bound", "#000000", "", (0, (3, 1.5)), 1.1),
}
# styles of other methods, selected by their name; triangles mark values beyond the axis, and stars
# values of the paper
_COLORS = ("#5f5f5f", "#a6611a", "#17a2a8")
_MARKERS = ("h", "8", "+", "x")
_LINES = ((0, (3, 1)), (0, (9, 3)), (0, (1, 1)))


def method_style(name: str) -> MethodStyle:
    """Return the style (label, colour, marker, line) of an identification method for figures.

    It is the same in every figure and every study.
    """
    if name in METHOD_STYLES:
        return METHOD_STYLES[name]
    first, second, third, *_ = sha256(name.encode()).digest()
    return MethodStyle(
        name.replace("_", " "),
        _COLORS[first % len(_COLORS)],
        _MARKERS[second % len(_MARKERS)],
        _LINES[third % len(_LINES)],
    )


def spoken(name: str) -> str:
    """Convert an identifier of the configuration to words: `non_resonant` to `non-resonant`."""
    return name.replace("_", " ").replace("non ", "non-")


@contextmanager
def styled(font_size: float) -> Iterator[None]:
    """Apply the project's matplotlib style in a `with` block, without the user's own settings."""
    labels = ("legend.fontsize", "xtick.labelsize", "ytick.labelsize")
    sizes = {"font.size": font_size, **dict.fromkeys(labels, 0.85 * font_size)}
    with matplotlib.style.context(["default", STYLE_FILE, sizes]):
        yield


def write_figure(
    svg: str | os.PathLike,
    png: str | os.PathLike,
    draw: Callable[[], Figure],
    dpi: float,
    font_size: float,
) -> None:
    """Draw a figure in the project's style and write it to an SVG and a PNG file.

    The label of the figure becomes the title in the files.
    """
    with styled(font_size):
        figure = draw()
        title = figure.get_label()
        if layout := figure.get_layout_engine():
            for axes in figure.axes:  # ticks point inwards: no spine needs room, but each is slow
                axes.spines[:].set_in_layout(False)
            layout.execute(figure)  # once, without drawing, for both files
            figure.set_layout_engine(None)
        for path, form in ((svg, "svg"), (png, "png")):
            options = SAVE_OPTIONS[form]
            metadata = options["metadata"] | ({"Title": title} if title else {})
            with replacing(path) as partial:
                figure.savefig(partial, format=form, dpi=dpi, **options | {"metadata": metadata})
                if form == "svg":
                    _shorten_paths(partial)


def _shorten_paths(svg: Path) -> None:
    """Shorten the paths of an SVG in place, to a tenth of a point (720 dpi)."""
    text = re.sub(r"\n +(?=<)", "\n", svg.read_text(encoding="utf-8"))
    text = SVG_PATHS.sub(
        lambda path: SURPLUS_BLANKS.sub(r"\1", SURPLUS_DIGITS.sub(r"\1", path[0])), text
    )
    svg.write_text(text, encoding="utf-8")
