"""The pages of docs/: numbers and pictures from results, links, length, what their code prints."""

import re
from functools import partial
from pathlib import Path

import pytest
from draw_examples import PICTURES, draw
from from_results import BLOCK, BLOCKS, with_tables
from matplotlib.testing.compare import compare_images
from studies import run

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
LINKED = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "config").glob("*.md")), *PAGES]
MAX_WORDS = 900  # of prose; tables, code and formulas are looked up
read = partial(Path.read_text, encoding="utf-8")


def test_tables_of_the_pages_are_made_from_the_results():
    texts = {page.name: read(page) for page in PAGES}
    outdated = [name for name, text in texts.items() if with_tables(text) != text]
    assert not outdated  # else: make docs
    used = [match[2] for text in texts.values() for match in BLOCK.finditer(text)]
    assert sorted(used) == sorted(BLOCKS)


def test_an_edited_number_of_a_page_is_noticed():
    text = read(DOCS / "trust.md")
    row = next(line for line in text.splitlines() if line.startswith("| lines with random"))
    number = re.search(r"\d[\d,]* of [\d,]+", row)[0]
    assert with_tables(text.replace(number, "1 of 2")) == text


@pytest.mark.slow
@pytest.mark.parametrize("name", PICTURES)
def test_pictures_of_the_pages_are_what_the_commands_draw(name, tmp_path):
    drawn = draw(name, tmp_path)
    differs = compare_images(ROOT / "examples" / f"{name}.png", drawn, tol=2.0)
    assert differs is None, f"make docs: {differs}"


def anchors(page):
    """What links to headings and targets of a page may name."""
    text = re.sub(r"```.*?```", "", read(page), flags=re.DOTALL)
    titles = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    slugs = (re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles)
    return {*slugs, *re.findall(r"^\(([\w-]+)\)=$", text, re.MULTILINE)}


@pytest.mark.parametrize("page", LINKED, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for link, anchor in re.findall(r"\]\((?!https?:)([^)#]*)(?:#([^)]*))?\)", read(page)):
        target = page.parent / link if link else page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), f"{link}#{anchor}"


def prose(text):
    """The words of a page without code, tables, formulas and directives."""
    text = re.sub(
        r"^(`{3,}).*?^\1|\$\$.*?\$\$|<!--.*?-->", "", text, flags=re.DOTALL | re.MULTILINE
    )
    return [word for line in text.splitlines() if not line.startswith("|") for word in line.split()]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_no_page_is_long(page):
    assert len(prose(read(page))) <= MAX_WORDS


def test_pages_name_modules_that_exist():
    paths = (ROOT / folder for folder in ("workflow", "examples", "tests"))
    names = {path.name for folder in paths for path in folder.rglob("*.py")}
    text = "".join(map(read, PAGES))
    named = {name.rpartition("/")[2] for name in re.findall(r"`([\w/]+\.py)`", text)}
    assert len(named) > 30 and named <= names


NUMBER = re.compile(r"\d+\.\d+")


@pytest.mark.filterwarnings("ignore")  # of pysindy
@pytest.mark.parametrize(
    "page",
    ["README.md", *(f"docs/{name}.md" for name in
                    ("beside_pysindy", "python", "tutorial_lorenz", "tutorial_systems"))],
)  # fmt: skip
def test_code_of_a_page_runs_and_prints_what_is_shown(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text, names = read(ROOT / page), {}
    for code in re.findall(r"```(?:python|{code-cell})\n(.*?)```", text, re.DOTALL):
        exec(compile(code, page, "exec"), names)
    printed = capsys.readouterr().out
    shown = "".join(re.findall(r"```text\n(.*?)```", text, re.DOTALL)) or printed
    assert printed and NUMBER.sub("#", printed) == NUMBER.sub("#", shown)
    found, said = ([*map(float, NUMBER.findall(of))] for of in (printed, shown))
    assert found == pytest.approx(said, rel=0.02)  # the last digits are those of a machine


@pytest.mark.slow
def test_pages_are_whole(tmp_path):
    build = ("-m", "sphinx", "-q", "-W", "--keep-going", "-d", tmp_path / "cache")
    done = run(ROOT, *build, DOCS, tmp_path / "pages", PATH="/usr/bin:/bin")
    assert done.returncode == 0, done.stdout
    pages = sorted((tmp_path / "pages").glob("*.html"))
    assert len(pages) >= len(PAGES)
    for page in pages:
        for kind, target in re.findall(r'(href|src)="([^"#?]+)', read(page)):
            if target.startswith(("http", "mailto")):
                assert kind == "href", f"{page.name} loads {target}"
            else:
                assert (page.parent / target).exists(), f"{page.name}: {target}"
    for name, shown in (
        ("tutorial_recording", "limit cycle"),
        ("ambient", "Random forces"),
        ("wind", "small motions grow above U"),
    ):
        assert shown in read(tmp_path / "pages" / f"{name}.html")
    for name in ("trust", "methods"):  # one definition, included
        assert "(posterior weight) of at most 20 %" in read(tmp_path / "pages" / f"{name}.html")
