"""One self-contained HTML page of a study: headline, settings, figures and tables with captions,
and the versions behind it.
"""

import re
from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import pandas as pd
from docutils.core import publish_parts
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from galloping.report.data_dictionary import meaning
from galloping.reproducibility.digest import commit, environment

LIBRARIES = ("numpy", "scipy", "pandas", "numba", "pysindy", "matplotlib", "snakemake")
PLAIN = " !'()*,/:;=@[]{}|^+"  # may stand in a data URI between double quotes
# of an SVG: what stands before it, its comments and its metadata
UNSEEN = re.compile(r"\A.*?(?=<svg)|<!--.*?-->\s*|<metadata>.*?</metadata>\s*", re.DOTALL)
OF_PAPER = re.compile(r"figure\d\d")  # names of the figures that the paper has, too
ENLARGED = 2.0  # px of the page for a pt of the print
MEDIA = {".svg": "image/svg+xml", ".png": "image/png", ".gif": "image/gif", ".csv": "text/csv"}


@dataclass(frozen=True)
class Item:
    """A figure (SVG, PNG or GIF) or a table (CSV) as the page shows it.

    label: its title. caption: reStructuredText.
    """

    name: str
    label: str
    caption: str
    path: Path

    @property
    def caption_html(self) -> Markup:
        return as_html(self.caption)

    @property
    def uri(self) -> Markup:
        """The whole file as a data URI, which may stand between double quotes as it is."""
        if self.path.suffix not in (".svg", ".csv"):
            content = f"base64,{b64encode(self.path.read_bytes()).decode()}"
        else:  # text is shorter as it is
            text = self.path.read_text(encoding="utf-8")
            if self.path.suffix == ".svg":
                text = UNSEEN.sub("", text).replace("; ", ";")
                text = text.replace('"', "'").replace("\n", " ") if "'" not in text else text
            content = f"charset=utf-8,{quote(text, safe=PLAIN)}"
        return Markup(f"data:{MEDIA[self.path.suffix]};{content}")

    @property
    def width(self) -> str:
        """Of an SVG on the page, its printed size enlarged for a screen; '' of other files."""
        if self.path.suffix != ".svg":
            return ""
        found = re.search(r'<svg[^>]* width="([\d.]+)pt"', self.path.read_text(encoding="utf-8"))
        return f"{ENLARGED * float(found[1]):.0f}px" if found else ""

    @property
    def rows(self) -> pd.DataFrame:
        """The cells of a table as text, numbers with four significant digits."""
        table = pd.read_csv(self.path, low_memory=False)
        for name in table.select_dtypes("float"):
            table[name] = [f"{value:.4g}" for value in table[name]]
        return table.astype(str).replace({"nan": "", "<NA>": ""})


def as_html(text: str) -> Markup:
    """reStructuredText as an HTML fragment. Raises docutils.utils.SystemMessage if it is broken."""
    settings = {"halt_level": 2, "report_level": 5, "file_insertion_enabled": False}
    return Markup(publish_parts(text, writer="html5", settings_overrides=settings)["body"])


def render(page: Mapping) -> str:
    """The page as HTML that refers to nothing outside itself, the same bytes for the same page.

    page: what it shows, by name. title. paper: what the paper prints beside ours, as of
    `printed_numbers.section`, with the figure `printed`, or None. made: by which commit. headline:
    sentences that say what was found beyond the paper, with the figure `first`. study: its
    settings, in plain values. introduction: reStructuredText. figures, tables: lists of Item.
    recordings: what those from the field gave, each with its name, a summary in Markdown, shown as
    it is, and figures. versions: of Python and the libraries, by name. pages: folder of the
    documents, from that of the report.
    """
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    template = environment.from_string(
        Path(__file__).with_name("page.html.jinja").read_text(encoding="utf-8")
    )
    of_paper = [item for item in page["figures"] if OF_PAPER.fullmatch(item.name)]
    others = [item for item in page["figures"] if item not in of_paper]
    groups = {"Figures of the paper": of_paper, "Figures beyond the paper": others}
    return template.render(
        page=page,
        figure_groups={title: items for title, items in groups.items() if items},
        introduction=as_html(page["introduction"]),
        meaning=meaning,
    )


def made_by() -> str:
    """The commit that a report is made by, in words."""
    known = commit()
    if known is None:
        return "code that is in no git repository"
    changed = f", with {len(known.changes)} files changed since" if known.changes else ""
    return f"commit {known.digest[:12]} of {known.date[:10]}{changed}"


def versions() -> dict[str, str]:
    """Of Python and the libraries that numbers and figures come from, as far as they are here: a
    conda environment of jobs has no Snakemake.
    """
    here = environment()
    packages = {name: here["packages"][name] for name in LIBRARIES if name in here["packages"]}
    return {"python": here["python"], **packages}
