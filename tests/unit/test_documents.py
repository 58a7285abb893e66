"""README and pages: their numbers are those of the reference, their links lead somewhere."""

import re
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]


def rows(claims):
    """The lines of the README's table of the paper's claims, from `paper.csv`."""
    for claim in claims.itertuples():
        if claim.verdict in ("reproduced", "better", "worse"):
            ours = f"{claim.median:.3g} % ({claim.low:.2g} to {claim.high:.3g})"
            yield f"| {claim.claim} | {claim.printed:g} % | {ours} | {claim.verdict} |"
        elif claim.claim.startswith("R2 of"):
            share = f"{100 * claim.share_of_draws:.0f} %"
            ours = f"{claim.median:.3f}, above the bound in {share} of the draws"
            yield f"| {claim.claim} | > {claim.printed:g} | {ours} | {claim.verdict} |"


@pytest.fixture(scope="module")
def claims():
    return pd.read_csv(ROOT / "results" / "reference" / "paper.csv")


def test_the_readme_has_the_claims_of_the_reference(claims):
    shown = [*rows(claims[~claims["claim"].str.contains("abstract", na=False)])]
    lines = (ROOT / "README.md").read_text().splitlines()
    first = lines.index(shown[0])
    assert lines[first : first + len(shown)] == shown
    single = claims[claims["printed"].notna()]
    said = re.search(r"Of (\d+) printed numbers and bounds (\d+) come out", "\n".join(lines))
    held = single["verdict"].isin(("reproduced", "met"))
    assert (int(said[1]), int(said[2])) == (len(single), held.sum())


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    links = re.findall(r"\]\((?!https?:)([^)#]*)(?:#[^)]*)?\)", page.read_text())
    missing = [link for link in links if link and not (page.parent / link).exists()]
    assert not missing
