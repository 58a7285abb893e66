"""How `make pages` builds the pages of this folder into results/pages, without a network."""

import os
import re
import shutil
import sys
import tempfile
from pathlib import Path

from docutils.nodes import SkipNode
from docutils.utils.math.latex2mathml import tex2mathml

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
ELSEWHERE = {"configuration": "config/README.md", "reruns": "config/reruns.md"}
PAGES = {**{path: f"{page}.md" for page, path in ELSEWHERE.items()}, "README.md": "index.md"}

project = "Galloping of iced overhead lines"
html_title = "Galloping"
html_theme = "furo"
html_static_path, html_css_files = ["pages.css"], ["pages.css"]
html_show_copyright = html_show_sphinx = html_copy_source = False
html_math_renderer = "mathml"  # which browsers draw without a script
extensions = [
    "matplotlib.sphinxext.plot_directive",
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_click",
    "sphinxcontrib.programoutput",
]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 600  # s, of a cell
autodoc_member_order = "bysource"
napoleon_google_docstring = False  # `states: names` begins a sentence
autodoc_typehints = "none"  # docstrings say shapes and units
plot_formats = ["svg"]
plot_html_show_formats = plot_html_show_source_link = False
plot_rcparams = {"figure.figsize": (7, 3.2), "figure.constrained_layout.use": True}


def _prepare_examples() -> None:
    """Make $EXAMPLES, a copy of the examples for the commands of the pages, and `galloping`."""
    folder = Path(tempfile.mkdtemp())
    shutil.copytree(ROOT / "examples", folder / "examples")
    command = folder / "galloping"
    code = "from galloping.cli import main; main(prog_name='galloping')"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "{code}" "$@"\n')
    command.chmod(0o755)
    os.environ["PATH"] = f"{folder}{os.pathsep}{os.environ['PATH']}"
    os.environ["EXAMPLES"] = str(folder / "examples")


def _with_links_of_pages(app, page, source) -> None:
    """Links between files, as a reader of the repository follows them, lead between the pages."""
    path = ROOT / ELSEWHERE.get(page, f"docs/{page}.md")

    def link(match: re.Match) -> str:
        text, target, anchor = match.groups()
        full = Path(os.path.normpath(path.parent / target))
        name = full.relative_to(ROOT).as_posix()
        if full.is_dir() or (full.suffix == ".md" and full.parent != HERE and name not in PAGES):
            return text
        return f"[{text}]({PAGES.get(name) or os.path.relpath(full, HERE)}{anchor or ''})"

    source[0] = re.sub(r"\[([^\]]*)\]\(((?!https?:)[^)#\s]+)(#[^)]*)?\)", link, path.read_text())


def _as_markdown(app, what, name, thing, options, lines) -> None:
    """Docstrings mark code by single backticks, as Markdown does."""
    lines[:] = [line.replace("`", "``") for line in lines]


def _without_substitutions(app, context, lines) -> None:
    """Bars in the help of options are absolute values."""
    lines[:] = [line.replace("|", "\\|") for line in lines]


def _keep_notebooks_inside(app) -> None:
    """Executed notebooks are written beside the pages, not in the folder that holds these."""
    folder = str(Path(app.outdir) / "notebooks")
    app.env.mystnb_config = app.env.mystnb_config.copy(output_folder=folder)


def _mathml(block: bool):
    def visit(translator, node) -> None:
        translator.body.append(tex2mathml(node.astext(), as_block=block))
        raise SkipNode

    return visit


def setup(app) -> None:
    _prepare_examples()
    app.connect("builder-inited", _keep_notebooks_inside, priority=900)  # after myst_nb's own
    app.connect("source-read", _with_links_of_pages)
    app.connect("autodoc-process-docstring", _as_markdown)
    app.connect("sphinx-click-process-options", _without_substitutions)
    app.add_html_math_renderer("mathml", (_mathml(False), None), (_mathml(True), None))
