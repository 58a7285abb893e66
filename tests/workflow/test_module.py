"""The study as a module of somebody else's workflow: their folder, Snakefile, settings and lines.

Of their lines one diverges and one never gallops.
"""

import json
import os
import subprocess
from textwrap import indent

import pandas as pd
import pytest
from studies import run

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("module")]

SNAKEFILE = """
configfile: "config.yaml"


rule all:
    input: "scores.txt", "study/report.html"

module galloping:
    snakefile: {snakefile}
    config: {config}

use rule * from galloping as galloping_*

rule count_scores:
    input: "study/tables/scores.csv"
    output: "scores.txt"
    script: "count.py"
"""
SCRIPT = """
from mine import count

with open(snakemake.input[0]) as table, open(snakemake.output[0], "w") as file:
    file.write(str(count(table)))
"""
LIBRARY = """
def count(lines):
    return len(list(lines)) - 1
"""
SETTINGS = """
results: study
cases:
  storm: {wind: {speed: 40}}
  calm: {wind: {speed: 3}}
simulation: {duration: 100, sampling_rate: 50, steady_window: [60, 100]}
measurement: {replicates: 1, protocols: [state], levels: [0.05], subsets: {points: [1000]}}
identification: {degree: 2, methods: [stlsq, maximum_likelihood]}
sweeps: {wind: {values: [2, 6, 4]}}
assessment:
  winds: [4, 8]
  design_wind: 3
figures: {dpi: 50}
"""


class User:
    """Somebody's folder with a workflow of their own, which takes this one from a clone."""

    def __init__(self, root, folder):
        self.clone, self.folder = repr(str(root / "workflow" / "Snakefile")), folder
        (folder / "lib").mkdir()
        (folder / "lib" / "mine.py").write_text(LIBRARY)
        (folder / "count.py").write_text(SCRIPT)

    def snakemake(
        self, *options, snakefile="", config="config", settings=SETTINGS, libraries=(), **variables
    ):
        """A run, with what their `module` says and their settings."""
        text = SNAKEFILE.format(snakefile=snakefile or self.clone, config=config)
        (self.folder / "Snakefile").write_text(text)
        (self.folder / "config.yaml").write_text(settings)
        paths = os.pathsep.join(map(str, (self.folder / "lib", *libraries)))
        command = ("-m", "snakemake", "--cores", "2", *options)
        return run(self.folder, *command, PYTHONPATH=paths, **variables)

    def table(self, name):
        return pd.read_csv(self.folder / "study" / "tables" / f"{name}.csv")


@pytest.fixture(scope="module")
def user(root, tmp_path_factory):
    """A user who has run their workflow once."""
    user = User(root, tmp_path_factory.mktemp("user"))
    run = user.snakemake()
    assert run.returncode == 0, run.stdout
    return user


def test_it_runs_to_the_end_in_the_users_folder(user):
    scores = user.table("scores").set_index("case")
    assert int((user.folder / "scores.txt").read_text()) == len(scores) > 0
    made = {path.name for path in user.folder.iterdir() if not path.name.startswith(".")}
    assert made == {"Snakefile", "config.yaml", "count.py", "lib", "scores.txt", "study"}
    assert set(user.table("reference_summary")["verdict"]) == {"no reference"}
    assert user.table("claims").empty  # of the paper, which are not about these lines
    receipts = (user.folder / "study").rglob(".*.receipt")
    rules = {json.loads(path.read_text(encoding="utf-8"))["rule"] for path in receipts}
    assert len(rules) >= 9 and all(rule.startswith("galloping_") for rule in rules)
    storm = scores.loc["storm"]
    assert storm["motion"].str.startswith("the line itself diverged").all()
    assert storm["r2_q_v"].isna().all()
    assert scores.loc["calm", "amplitude_error_q_v_percent"].isna().all()
    cycles = user.table("limit_cycles").query("case == 'calm' and branch == 'simulation'")
    assert set(cycles["kind"]) == {"rest", "cycle"} and len(cycles) == 2


@pytest.fixture(scope="module")
def host(fresh, tmp_path_factory):
    """Settings of git that make this repository the one at the user's git host."""
    folder = tmp_path_factory.mktemp("host")
    repository = folder / "someone" / "galloping.git"
    repository.parent.mkdir()
    git = ["git", "-c", "user.name=someone", "-c", "user.email=someone@example.org"]
    git += [f"--git-dir={repository}", f"--work-tree={fresh.folder}"]
    for command in (["init", "-b", "main"], ["add", "-A"], ["commit", "-m", "all"]):
        subprocess.run([*git, *command], check=True, stdout=subprocess.DEVNULL)
    return {
        "GIT_CONFIG_COUNT": "1",
        "GIT_CONFIG_KEY_0": f"url.file://{folder}/.insteadOf",
        "GIT_CONFIG_VALUE_0": "https://github.com/",
        "XDG_CACHE_HOME": str(folder / "cache"),
    }


def has_nothing_to_do(run):
    return run.returncode == 0 and "Nothing to be done" in run.stdout


def test_settings_may_stand_in_a_section_beside_others(user):
    settings = f"mine: 1\ngalloping:\n{indent(SETTINGS, '  ')}"
    run = user.snakemake(config='config["galloping"]', settings=settings)
    assert has_nothing_to_do(run), run.stdout


def test_it_can_be_read_from_a_host_beside_the_installed_library(user, host, root):
    """And is the same study: what was made through a clone is up to date."""
    host = host | {
        "snakefile": 'github("someone/galloping", path="workflow/Snakefile", branch="main")'
    }
    seen = user.folder / ".snakemake" / "library"  # by jobs in conda environments, and no more
    seen.mkdir()
    (seen / "galloping").symlink_to(user.folder)  # as of an earlier installation
    profile, library = root / "workflow" / "profiles" / "default", root / "workflow" / "src"
    run = user.snakemake("--profile", str(profile), libraries=[library], **host)
    assert has_nothing_to_do(run), run.stdout
    assert [path.resolve() for path in seen.iterdir()] == [library.resolve() / "galloping"]
    run = user.snakemake(**host)
    assert run.returncode != 0
    last = run.stdout.splitlines()[-1]
    assert last.startswith("No module named 'galloping': install the library of this workflow")
