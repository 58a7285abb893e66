"""What is installed where: packages that are declared, locked, there for every system, compiled."""

import ast
import re
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import check_wheels
import pytest
import write_environment
import yaml
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name
from packaging.version import Version
from studies import run

ROOT = Path(__file__).parents[2]
SOURCE, SCRIPTS = ROOT / "workflow" / "src" / "galloping", ROOT / "workflow" / "scripts"
PYPROJECT = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
PROJECT = tomllib.loads(PYPROJECT)["project"]
OWN = {
    path.stem for folder in ("tests", "workflow", "docs") for path in (ROOT / folder).rglob("*.py")
}
OWN |= {"galloping", *sys.stdlib_module_names}
LOCKS = ("requirements.lock", "requirements-dev.lock")
# Of the library, what commands run and jobs never do.
WITHOUT_JOBS = {"publication", "plan", "lock", "repair"}
COMPILED = (
    "trajectory.taylor",
    "identification.likelihood.condense",
    "identification.preparation.smoothing",
    "identification.random_forces.kalman",
)


def imported(paths):
    """(package, file) of all that Python files import, wherever in them, from other projects."""
    for path in paths:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            else:
                names = [node.module] if isinstance(node, ast.ImportFrom) else []
            yield from (
                (top, path.name) for name in names if (top := name.split(".")[0]) not in OWN
            )


def outside(paths, names):
    """What files import that no distribution of these names brings, or none at all."""
    brought = {"rocrate_validator": ["roc-validator"], **metadata.packages_distributions()}
    return {
        (package, file)
        for package, file in imported(paths)
        if not {canonicalize_name(one) for one in brought.get(package, [package])} & names
    }


def declared(*extras):
    listed = (write_environment.requirements(PROJECT, extra) for extra in extras)
    return {canonicalize_name(name) for each in listed for name, _ in each}


def locked(name):
    """(package, version) of each line of a lock."""
    text = (ROOT / name).read_text(encoding="utf-8")
    return set(re.findall(r"^([a-z0-9-]+)==(\S+)", text, re.MULTILINE))


@pytest.mark.parametrize(
    ("folder", "extras"),
    [
        ("workflow/src/galloping/behaviour", ["field"]),
        ("workflow/src/galloping/summary", ["field"]),
        ("workflow/src", ["test"]),
        ("workflow/scripts", ["test", "bench"]),
        ("docs", ["pages"]),
        ("tests", ["dev", "bench"]),
    ],
)
def test_every_import_is_declared(folder, extras):
    paths = list((ROOT / folder).rglob("*.py"))
    assert paths and outside(paths, declared(*extras)) == set()


def test_install_lines_of_all_pages_name_extras_that_there_are():
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "config").glob("*.md")]
    lines = re.findall(
        r"pip install '?(?:\.|galloping)\[([\w,]+)\]", "".join(map(Path.read_text, pages))
    )
    extras = {extra for line in lines for extra in line.split(",")}
    assert "field" in extras and extras <= PROJECT["optional-dependencies"].keys()


def test_the_conda_environment_is_that_of_pyproject_and_holds_what_jobs_import():
    text = write_environment.ENVIRONMENT.read_text(encoding="utf-8")
    assert text == write_environment.environment(PYPROJECT)
    *conda, last = yaml.safe_load(text)["dependencies"]
    names = {each.split()[0].removesuffix("-base") for each in (*conda, *last["pip"])}
    rules = "".join(path.read_text("utf-8") for path in (ROOT / "workflow/rules").glob("*.smk"))
    jobs = [SCRIPTS / f"{name}.py" for name in re.findall(r"scripts/(\w+)\.py", rules)]
    library = [
        path
        for path in SOURCE.rglob("*.py")
        if not WITHOUT_JOBS & {path.stem, *path.relative_to(SOURCE).parts}
    ]
    assert len(jobs) > 15 and outside((*jobs, *library), names) == set()


def test_the_lock_of_the_study_is_part_of_that_of_development():
    study, development = map(locked, LOCKS)
    assert study < development
    names = {name for name, _ in study}
    assert {"snakemake", "pysindy", "pytest"} < names
    assert not names & {"sphinx", "selenium", "ruff", "snakemake-executor-plugin-slurm"}
    assert not any("://" in (ROOT / name).read_text(encoding="utf-8") for name in LOCKS)


@pytest.mark.slow
@pytest.mark.parametrize("python", ["3.11", "3.14"])
@pytest.mark.parametrize("system", check_wheels.SYSTEMS)
def test_every_system_has_packages_that_need_no_compiler(system, python):
    done = check_wheels.resolve_lock(ROOT / "requirements.lock", system, python)
    if any(sign in done.stdout for sign in check_wheels.NETWORK_ERRORS):
        pytest.skip("no package index answers")
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_the_newest_snakemake_plans_the_study(fresh, tmp_path):
    """The interface that `plan.py` uses is not stable: what is newer than the cap breaks here."""
    done = run(ROOT, "-m", "pip", "install", "--quiet", "--target", tmp_path, "snakemake")
    if done.returncode:
        pytest.skip(f"no package index answers: {done.stdout[-200:]}")
    code = (
        "import snakemake; from galloping.reproducibility import plan; "
        "print(snakemake.__version__, len(plan.make_plan(['config/smoke.yaml']).jobs))"
    )
    paths = f"{tmp_path}:{fresh.folder / 'workflow' / 'src'}"
    done = run(fresh.folder, "-c", code, PYTHONPATH=paths)
    requirements = dict(write_environment.requirements(PROJECT, "study"))
    cap = requirements["snakemake"]
    assert done.returncode == 0, f"the newest Snakemake breaks plan.py: {cap}\n{done.stdout}"
    version, jobs = done.stdout.split()[-2:]
    assert int(jobs) > 100
    assert Version(version) in SpecifierSet(cap), f"Snakemake {version} works: raise {cap}"


@pytest.mark.parametrize("module", ["galloping", "galloping.cli"])
def test_modules_are_the_command_as_well(module):
    done = run(ROOT, "-m", module, "--version")
    assert (done.returncode, done.stdout) == (0, f"galloping, version {PROJECT['version']}\n")


@pytest.mark.parametrize("package", ["click", "pandas"])
def test_a_package_that_the_command_lacks_is_one_line_with_how_to_install_it(package):
    code = (
        f"import runpy, sys; sys.modules[{package!r}] = None; "
        "sys.argv = ['galloping', 'inspect', 'examples/ambient.csv']; "
        "runpy.run_module('galloping', run_name='__main__')"
    )
    done = run(ROOT, "-c", code)
    (line,) = done.stdout.splitlines()
    assert done.returncode == 1
    assert line.startswith(f"Error: {package} ") and line.endswith(f"pip install {package}")


FIRST_FIT = """
import sys
from importlib import import_module

import compile_library
from numba.core.registry import CPUDispatcher

import galloping


def compiled():
    modules = [vars(import_module(f"galloping.{name}")).values() for name in sys.argv[1:]]
    every = [one for module in modules for one in module if isinstance(one, CPUDispatcher)]
    return {f"{one.__module__}.{one.__name__}": len(one.signatures) for one in every}


compile_library.main()
beforehand = compiled()
time = [k / 25 for k in range(500)]
for library in ("q + dq + q^3", "q + dq + cos(q)", "q + dq + |dq|*dq"):
    terms, _ = galloping.library(library, ["q", "dq"])
    line = galloping.PolynomialModel(("q", "dq"), terms, [[0, 1, 0], [-9, -0.1, -1]])
    recording = galloping.measure(line, galloping.simulate(line, [1, 0], time), level=0.02)
    galloping.maximum_likelihood(recording, terms)
for name, count in compiled().items():
    print(name, beforehand[name], count)
"""


@pytest.mark.slow
def test_what_is_compiled_beforehand_is_all_that_a_first_fit_compiles(tmp_path):
    done = run(SCRIPTS, "-c", FIRST_FIT, *COMPILED, NUMBA_CACHE_DIR=str(tmp_path))
    assert done.returncode == 0, done.stdout
    counts = [line.split()[1:] for line in done.stdout.splitlines()]
    assert len(counts) > 20, done.stdout
    assert all(before == after != "0" for before, after in counts), done.stdout


DIGEST = """
import hashlib, numpy as np, galloping
line, time = galloping.derive(), np.arange(6000) / 100
motion = galloping.simulate(line, [0.6, 0.9, 0, 0], time).states
bound = galloping.cramer_rao_bound(line, [0.6, 0.9, 0, 0], time, [0.1] * 4)
print(hashlib.sha256(motion.tobytes() + bound.tobytes()).hexdigest())
"""


@pytest.mark.slow
def test_code_that_was_just_compiled_gives_the_bits_of_cached_code(tmp_path):
    first, again = (run(SCRIPTS, "-c", DIGEST, NUMBA_CACHE_DIR=str(tmp_path)) for _ in range(2))
    assert first.returncode == 0 and first.stdout == again.stdout, first.stdout + again.stdout
