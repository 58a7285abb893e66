"""Self-contained HTML page of a study: the paper, methods, line engineering, and an appendix.

The appendix has all tables, and the versions of the packages.
"""

import re
from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass
from html import unescape
from math import inf, isfinite
from pathlib import Path
from urllib.parse import quote

import pandas as pd
from docutils.core import publish_parts
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from galloping.report.data_dictionary import meaning
from galloping.reproducibility.digest import Commit, environment

LIBRARIES = ("numpy", "scipy", "pandas", "numba", "pysindy", "matplotlib", "snakemake")
URI_CHARACTERS = " !'()*,/:;=@[]{}|^+"  # not escaped in a data URI between double quotes
# invisible parts of an SVG: text before it, comments, metadata and title
INVISIBLE_PARTS = re.compile(
    r"\A.*?(?=<svg)|<!--.*?-->\s*|<(metadata|title)>.*?</\1>\s*", re.DOTALL
)
PAPER_FIGURE = re.compile(r"figure(\d\d)")  # name of a figure of the paper
TITLE = re.compile(r"<title>(.*?)</title>", re.DOTALL)
PIXELS_PER_POINT = 1.8  # scale of a figure on the page
COLUMN_WIDTH = 260.0  # pt: wider figures fill the width of the page
PART_TITLES = {"paper": "The paper", "methods": "Methods", "engineering": "Line engineering"}
MEDIA = {".svg": "image/svg+xml", ".png": "image/png", ".gif": "image/gif", ".csv": "text/csv"}


@dataclass(frozen=True)
class Item:
    """Figure (SVG, PNG, GIF) or table (CSV) on the report page, with its label and caption.

    label: subject, in a few words. caption: reStructuredText.
    """

    name: str
    label: str
    caption: str
    path: Path

    @property
    def title(self) -> str:
        """Title of the figure, from its SVG file or its label, with its number in the paper."""
        found = TITLE.search(self._svg_text)
        number = PAPER_FIGURE.fullmatch(self.name)
        head = str(int(number[1])) if number else ""
        text = unescape(found[1]) if found else self.label.removeprefix(head).lstrip()
        text = text[:1].upper() + text[1:]
        return f"Figure {head}. {text}" if number else text

    @property
    def caption_html(self) -> Markup:
        """Caption of the figure or table, converted to HTML."""
        return as_html(self.caption)

    @property
    def _svg_text(self) -> str:
        return self.path.read_text(encoding="utf-8") if self.path.suffix == ".svg" else ""

    @property
    def _width_in_points(self) -> float:
        """Printed width of an SVG in pt, infinite for other files."""
        found = re.search(r'<svg[^>]* width="([\d.]+)pt"', self._svg_text)
        return float(found[1]) if found else inf

    @property
    def is_wide(self) -> bool:
        """Whether the figure is wider than a column of the page."""
        return self._width_in_points > COLUMN_WIDTH

    @property
    def width(self) -> str:
        """Width of an SVG figure on the page as a CSS length; '' for other files."""
        points = self._width_in_points
        return f"{PIXELS_PER_POINT * points:.0f}px" if isfinite(points) else ""

    @property
    def uri(self) -> Markup:
        """Contents of the file as a data URI that can be put between double quotes."""
        if self.path.suffix not in (".svg", ".csv"):
            content = f"base64,{b64encode(self.path.read_bytes()).decode()}"
        else:  # base64 would be longer
            text = self.path.read_text(encoding="utf-8")
            if self.path.suffix == ".svg":
                text = INVISIBLE_PARTS.sub("", text).replace("; ", ";")
                text = text.replace('"', "'").replace("\n", " ") if "'" not in text else text
            content = f"charset=utf-8,{quote(text, safe=URI_CHARACTERS)}"
        return Markup(f"data:{MEDIA[self.path.suffix]};{content}")

    @property
    def rows(self) -> pd.DataFrame:
        """Contents of the table as text, with four significant digits per number."""
        table = pd.read_csv(self.path, low_memory=False)
        for name in table.select_dtypes("float"):
            table[name] = [f"{value:.4g}" for value in table[name]]
        return table.astype(str).replace({"nan": "", "<NA>": ""})


def as_html(text: str) -> Markup:
    """Convert reStructuredText to HTML; raise docutils.utils.SystemMessage if it is broken."""
    settings = {"halt_level": 2, "report_level": 5, "file_insertion_enabled": False}
    return Markup(publish_parts(text, writer="html5", settings_overrides=settings)["body"])


def render(page: Mapping) -> str:
    """Render the report page of a study as HTML without external references.

    page: contents, by name. title. paper: comparison with the paper, as of
    `printed_numbers.section`, or None. equations: as of `side_by_side`, or None. made: by which
    commit. parts: by name (PART_TITLES) sentences and figures, lists of str and Item. study: its
    settings, in plain values. introduction: reStructuredText. tables: list of Item. recordings:
    results of field recordings, each with its name, a summary in Markdown, shown unchanged, and
    figures. versions: of Python and the libraries, by name.
    """
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    return environment.get_template("page.html.jinja").render(
        page=page,
        titles=PART_TITLES,
        anchors={f"table-{item.name}" for item in page["tables"]},
        introduction=as_html(page["introduction"]),
        meaning=meaning,
    )


def made_by(present: Commit | None) -> str:
    """Describe the git commit of the code that makes the report, as text."""
    if present is None:
        return "code that is in no git repository"
    count = len(present.changes)
    changed = f" and {count} changed file{'s' * (count > 1)}" if count else ""
    return f"commit {present.digest[:12]} of {present.date[:10]}{changed}"


def versions() -> dict[str, str]:
    """Return the installed versions of Python and the libraries that compute numbers and figures.

    A conda environment of jobs has no Snakemake.
    """
    here = environment()
    packages = {name: here["packages"][name] for name in LIBRARIES if name in here["packages"]}
    return {"python": here["python"], **packages}
