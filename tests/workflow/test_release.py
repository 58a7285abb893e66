"""A release: what speaks against one, what an index shows of it, and both files of it installed."""

import re
import shutil
import subprocess
import tomllib
import venv
from importlib.util import find_spec
from pathlib import Path

import check_wheels
import pytest
import release
import yaml

ROOT = Path(__file__).parents[2]
NAMED = (
    "pyproject.toml",
    "CITATION.cff",
    "SECURITY.md",
    "CHANGELOG.md",
    "workflow/src/galloping/__init__.py",
)
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
MAX_MEGABYTES = 450  # of `pip install .`, without pip itself
EDITS = {  # what a maintainer fills in
    "pyproject.toml": {"example.org/OWNER": "host.net/me", "The galloping authors": "A. Nyone"},
    "CITATION.cff": {"The galloping authors": "A. Nyone"},
    "SECURITY.md": {"example.org": "host.net"},
    "CHANGELOG.md": {"## 0.1.0 - not released yet": "## 0.1.0 - 2027-01-30"},
}


def edited(folder, edits):
    """The files that a release looks at, with some texts in them replaced."""
    for name in NAMED:
        text = (ROOT / name).read_text(encoding="utf-8")
        for old, new in edits.get(name, {}).items():
            assert old in text
            text = text.replace(old, new)
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return list(release.objections(folder))


def test_nothing_speaks_against_a_release_once_placeholders_are_filled_in(tmp_path):
    assert edited(tmp_path, EDITS) == []


@pytest.mark.parametrize("name", EDITS)
def test_a_placeholder_speaks_against_a_release(tmp_path, name):
    against = edited(tmp_path, {other: of for other, of in EDITS.items() if other != name})
    assert against and all(line.startswith(f"{name}: ") for line in against)


def test_a_version_that_differs_speaks_against_a_release(tmp_path):
    edits = EDITS | {"workflow/src/galloping/__init__.py": {'"0.1.0"': '"0.2.0"'}}
    assert edited(tmp_path, edits) == ["galloping.__version__: 0.2.0; pyproject.toml has 0.1.0"]


def test_a_release_without_git_is_one_line(tmp_path):
    edited(tmp_path, {})
    with pytest.raises(SystemExit) as end:
        release.build(tmp_path, tmp_path / "dist")
    assert end.value.code == f"{tmp_path}: git tracks no files here; a release needs a git clone"


def test_links_and_pictures_of_the_readme_show_on_an_index():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    full = release.with_full_links(text, "https://host.net/me/galloping", "0.1.0")
    targets = re.findall(r"\]\(([^)]+)\)", full)
    own = [target for target in targets if target.startswith("https://host.net/")]
    assert len(own) > 10 and all(target.startswith(("https://", "#")) for target in targets)
    for target in own:
        kind, path = target.removeprefix("https://host.net/me/galloping/").split("/v0.1.0/")
        assert (ROOT / path.partition("#")[0]).exists()
        assert kind == ("raw" if path.endswith((".png", ".gif")) else "blob")


def test_public_ci_runs_commands_that_there_are_on_the_pythons_that_are_named():
    goals = set(re.findall(r"^([a-z-]+)(?: [a-z-]+)*:", (ROOT / "Makefile").read_text(), re.M))
    ours = yaml.safe_load((ROOT / ".github/workflows/tests.yml").read_text(encoding="utf-8"))
    docs = yaml.safe_load((ROOT / ".readthedocs.yaml").read_text(encoding="utf-8"))
    steps = [step for job in ours["jobs"].values() for step in job["steps"]]
    lines = [step.get("run", "") for step in steps] + docs["build"]["commands"]
    made = re.findall(r"make ([a-z-]+)", "\n".join(lines))
    assert {"test", "pages"} <= set(made) <= goals | {"study"}
    matrix = ours["jobs"]["library"]["strategy"]["matrix"]
    assert matrix["python"] == list(check_wheels.PYTHONS)
    assert len(matrix["system"]) == len(check_wheels.SYSTEMS)
    assert any("make test SLOW=yes" in line for line in lines)
    assert "make test SLOW=yes" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")


# --- both distributions, built and installed ---


@pytest.fixture(scope="module")
def distributions(tmp_path_factory):
    """(wheel, source distribution)."""
    if not find_spec("build"):
        pytest.skip("build is not installed: make tools")
    folder = tmp_path_factory.mktemp("dist")
    done = release.build(ROOT, folder)
    if done.returncode and any(sign in done.stdout for sign in ("No matching", "connection")):
        pytest.skip("no package index answers")
    assert done.returncode == 0, done.stdout
    (wheel,), (source,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    return wheel, source


class Clean:
    """An environment of its own, in which nothing of this one is seen."""

    def __init__(self, folder):
        venv.create(folder, with_pip=True)
        self.bin = folder / "bin"
        (self.site,) = folder.glob("lib/python*/site-packages")
        self.before = self.megabytes()

    def megabytes(self):
        return sum(path.stat().st_size for path in self.site.rglob("*") if path.is_file()) / 2**20

    def run(self, command, *arguments):
        return subprocess.run(
            [self.bin / command, *map(str, arguments)], cwd=self.bin, env={"PATH": "/usr/bin:/bin"},
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
        )  # fmt: skip

    def install(self, *arguments):
        done = self.run("python", "-m", "pip", "install", "--quiet", *arguments)
        assert done.returncode == 0, done.stdout


@pytest.mark.slow
@pytest.mark.xdist_group("release")
def test_the_wheel_and_the_source_run_in_a_clean_environment(distributions, tmp_path):
    wheel, source = distributions
    clean = Clean(tmp_path / "clean")
    clean.install(wheel)
    assert clean.megabytes() - clean.before <= MAX_MEGABYTES
    code = (
        "import galloping, numpy; line = galloping.derive(); t = numpy.arange(2000) / 20; "
        "r = galloping.measure(line, galloping.simulate(line, [.1, .1, 0, 0], t), level=.05); "
        "print(galloping.weak_gls(r, galloping.polynomial_library(4, 3)).equations()[0])"
    )
    done = clean.run("python", "-c", code)
    assert done.stdout == "d(q_v)/dt = 1 dq_v\n", done.stdout
    lacking = clean.run("galloping", "--version")
    assert lacking.returncode == 1 and len(lacking.stdout.splitlines()) == 1
    named = lacking.stdout.partition("pip install ")[2].replace("'", "").split()
    assert any(each.startswith("click") for each in named)
    clean.install(*named)  # the line that the message names
    done = clean.run("galloping", "identify", ROOT / "examples/ambient.csv", "--output", "out")
    assert done.returncode == 0 and (clean.bin / "out" / "summary.md").exists(), done.stdout
    clean.install("--no-deps", "--force-reinstall", source)
    done = clean.run("python", "-m", "galloping", "--version")
    assert done.stdout == f"galloping, version {PROJECT['version']}\n"
    shutil.rmtree(tmp_path / "clean")
