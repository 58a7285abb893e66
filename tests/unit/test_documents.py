"""README and pages: their numbers are those of the reference, their links lead somewhere."""

import re
import tomllib
from pathlib import Path

import pandas as pd
import pytest

from galloping.intervals import QUANTILES_95
from galloping.storage import read_json

ROOT = Path(__file__).parents[2]
PROCESSORS = {"znver3": "AMD Zen 3", "rocketlake": "Intel Rocket Lake"}  # as a reference has them
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


def sentences(claims):
    """What the README says in numbers beside that table, with the numbers of their sources."""
    origin, smoke = (
        read_json(ROOT / "results" / "reference" / folder / "origin.json")
        for folder in ("", "smoke")
    )
    settings = origin["settings"]
    measured, first = settings["measurement"], settings["cases"]["internal_resonance"]
    single = claims[claims["printed"].notna()]
    held = single["verdict"].isin(("reproduced", "met"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    ended = pd.read_csv(ROOT / "examples" / "span.csv").iloc[-1, 0]
    (processor,) = (name for code, name in PROCESSORS.items() if code in origin["processor"])
    other = min(settings["assessment"]["open_parameters"]["release_vertical"])
    level = 100 * measured["subsets"]["level"]
    assert other < first["initial_state"]["q_v"]
    yield f"postprint of {pd.Timestamp(str(measured['seed'])):%-d %B %Y}"
    yield f"with a {100 * (QUANTILES_95[1] - QUANTILES_95[0]):.0f} % band"
    yield f"from one recording at {first['wind']['speed']:g} m/s with {level:g} % noise"
    yield f"Python {project['requires-python'].removeprefix('>=')} or newer"
    minutes = f"{origin['core_minutes']:.0f} minutes"
    yield f"{processor} processors the jobs of `make` take {minutes} of one core"
    yield f"takes {smoke['core_minutes']:g} minutes of one core there"
    yield f"Of {len(single)} printed numbers and bounds {held.sum()} come out"
    yield f"of {measured['paper_draws']} draws of the noise"
    yield f"to {other:g} m, and the report begins with"
    yield f"# {ended:.0f} s of a galloping span"


def test_every_number_of_the_readme_has_a_source(claims):
    text = " ".join((ROOT / "README.md").read_text().split())
    for said in [*sentences(claims), *rows(claims)]:
        assert said in text or said.startswith("|"), said
        text = text.replace(said, "")
    for code in (r"`[^`]*`", r"\]\([^)]*\)", r"--duration \d+", r"U=[\d:]+", "SHA-256"):
        text = re.sub(code, "", text)
    assert re.findall(r"\S*\d\S*", text) == []


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
