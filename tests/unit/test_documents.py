"""README and pages: their tables are those of the reference, their links lead somewhere."""

import re
from pathlib import Path

import pandas as pd
import pytest

from galloping.storage import read_json

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


def test_the_readme_has_the_claims_of_the_reference():
    claims = pd.read_csv(ROOT / "results" / "reference" / "paper.csv")
    shown = [*rows(claims[~claims["claim"].str.contains("abstract", na=False)])]
    lines = (ROOT / "README.md").read_text().splitlines()
    first = lines.index(shown[0])
    assert lines[first : first + len(shown)] == shown


def test_the_readme_says_what_the_reference_measured():
    claims = pd.read_csv(ROOT / "results" / "reference" / "paper.csv")
    single = claims[claims["printed"].notna()]
    held = single["verdict"].isin(("reproduced", "met")).sum()
    whole, smoke = (
        read_json(ROOT / "results" / "reference" / folder / "origin.json")["core_minutes"]
        for folder in ("", "smoke")
    )
    text = " ".join((ROOT / "README.md").read_text().split())
    for said in (f"take {whole:.0f} minutes of one core", f"takes {smoke:g} minutes of one core",
                 f"Of {len(single)} printed numbers and bounds {held} come out"):  # fmt: skip
        assert said in text


def errors_of_models():
    """The lines of the table of limits, from `make reality`."""
    found = pd.read_csv(ROOT / "results" / "reference" / "reality" / "model_error.csv")
    for row in found[found["method"] == "maximum_likelihood"].to_dict("records"):
        cells = [
            "no cycle"
            if pd.isna(row[f"{what}_v_error_percent"])
            else f"{max(row[f'{what}_{d}_error_percent'] for d in 'vw'):.2g} % "
            f"({float(format(max(row[f'{what}_{d}_worst_percent'] for d in 'vw'), '.2g')):g})"
            for what in ("amplitude", "damping", "frequency")
        ]
        held = f"{row['coverage_95_percent']:.0f} %"
        yield f"| {row['truth']}, {row['sensors']} | {' | '.join(cells)} | {held} |"


def exact_terms():
    """The lines of the table beside published methods, from `make published`."""
    found = pd.read_csv(ROOT / "results" / "reference" / "published" / "published_terms.csv")
    lorenz = found[found["system"] == "lorenz"]
    few = lorenz["level"].isin([0.1, 0.2, 0.3, 0.4]) & lorenz["duration"].isin([4, 7, 10])
    for name, cells in (
        ("mean of all 112 cells: noise 2.5 to 40 %, 4 to 10 s", lorenz),
        ("noise 10, 20, 30, 40 % and 4, 7, 10 s", lorenz[few]),
        ("noise up to 12.5 %", lorenz[lorenz["level"] <= 0.125]),
        ("noise from 22.5 %", lorenz[lorenz["level"] >= 0.225]),
        ("4 s", lorenz[lorenz["duration"] == 4]),
        ("10 s", lorenz[lorenz["duration"] == 10]),
    ):
        shares = cells[["exact", "odr_bindy", "jsindy", "ensemble_weak_sindy"]].mean()
        yield f"| {name} | {' | '.join(f'{100 * share:.1f}' for share in shares)} |"


def test_the_limits_are_those_of_the_reference():
    lines = (ROOT / "docs" / "trust.md").read_text().splitlines()
    assert [line for line in [*errors_of_models(), *exact_terms()] if line not in lines] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    links = re.findall(r"\]\((?!https?:)([^)#]*)(?:#[^)]*)?\)", page.read_text())
    missing = [link for link in links if link and not (page.parent / link).exists()]
    assert not missing
