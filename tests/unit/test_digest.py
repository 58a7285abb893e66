"""The code digest changes with what a script runs, its libraries too, and with nothing else."""

import ast
import importlib
from importlib import metadata
from operator import attrgetter

import pytest

from galloping import deferred
from galloping.reproducibility import digest

SCRIPT = '''"""A script."""

import sys

from package.stage import work


def main():
    """Works."""
    work(sys.argv)


main()
'''
FILES = {
    "__init__.py": '"""A package."""\n',
    "stage.py": '"""A stage."""\n\nimport json\nfrom package.part.deep import LIMIT, OTHER\n\n\n'
    'def work():\n    """Works."""\n    return 2 * LIMIT\n\n\nclass Stage:\n    limit = LIMIT\n',
    "part/__init__.py": "",
    "part/deep.py": "from package import base\n\nLIMIT = base.ONE\nOTHER = 2\n",
    "base.py": "ONE = 1\n",
    "other.py": "OTHER = 1\n",
    "method.py": "import package.other\n",
}


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Writes files of a small package and returns the digest of the script that uses it."""
    source = tmp_path / "src"
    monkeypatch.setattr(deferred, "SOURCE", source)
    monkeypatch.setattr(digest, "PACKAGE", "package")
    script = tmp_path / "scripts" / "script.py"

    def write(name=None, text=None, *, modules=()):
        """Write a module, or the script, and return the digest."""
        if name:
            path = script if name == "script.py" else source / "package" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        forget()
        return digest.code(script, *modules)["digest"]

    for name, text in {"script.py": SCRIPT, **FILES}.items():
        write(name, text)
    yield write
    forget()


def forget():
    """As in another process."""
    for cached in (digest.code, digest._parse_module, deferred.file_of, digest._with_requirements,
                   digest._find_distribution):  # fmt: skip
        cached.cache_clear()
    importlib.invalidate_caches()


TWICE = "return 2 * LIMIT"
WORDS = [
    ("stage.py", '"""Works."""', '"""Works hard."""'),
    ("stage.py", '"""A stage."""\n', ""),
    ("stage.py", TWICE, "return 2 * LIMIT  # twice"),
    ("stage.py", TWICE, "return (\n        2 * LIMIT\n    )"),
    ("script.py", '    """Works."""\n', "    # works\n"),
]
CODE = [
    ("script.py", "work(sys.argv)", "work()"),
    ("stage.py", TWICE, "return 3 * LIMIT"),
    ("stage.py", TWICE, "text = '''words'''\n    return 2 * LIMIT"),
    ("base.py", "ONE = 1", "ONE = 1.0"),
    ("part/__init__.py", "", "import os\n"),
    ("part/page.jinja", "one", "two"),
    ("part/data.csv", "one", "two"),
    ("part/look.mplstyle", "one", "two"),
]


@pytest.mark.parametrize(("name", "old", "new"), [*WORDS, *CODE])
def test_code_changes_the_digest_however_deep_and_words_do_not(package, name, old, new):
    text = {"script.py": SCRIPT, **FILES}.get(name, "one")
    before = package(name, text)
    assert old in text
    assert (package(name, text.replace(old, new)) != before) == ((name, old, new) in CODE)


def test_what_runs_a_script_and_computes_nothing_does_not_count(package, monkeypatch):
    monkeypatch.setattr(digest, "UNCOUNTED", ("package.guard",))
    script = SCRIPT.replace("import sys\n", "import sys\nfrom package.guard import run\n")
    package("guard.py", "from package import other\n\nrun = 'no space left'\n")
    before = package("script.py", script)
    assert package("guard.py", "from package import other\n\nrun = 'the disk is full'\n") == before
    assert package("other.py", "OTHER = 2\n") == before
    assert package("base.py", "ONE = 2\n") != before


def test_a_misspelt_module_is_named(package):
    with pytest.raises(ValueError, match=r"package\.methods: "):
        package(modules=["package.methods"])


@pytest.mark.parametrize("name", ["table", "tables.score", "tables.scores.noise"])
def test_a_misspelt_function_is_named(name):
    with pytest.raises(AttributeError, match=f"galloping.{name}: "):
        attrgetter(name)(deferred)


def test_compiled_functions_use_no_other_module_of_the_package():
    # numba's cache of a function notices edits of its own file alone
    compiled = 0
    for path in (deferred.SOURCE / digest.PACKAGE).rglob("*.py"):
        tree = ast.parse(path.read_text())
        others = {
            alias.asname or alias.name
            for node in tree.body
            if isinstance(node, ast.ImportFrom) and node.module.startswith(digest.PACKAGE)
            for alias in node.names
        }
        for node in tree.body:
            if "njit" in " ".join(map(ast.unparse, getattr(node, "decorator_list", ()))):
                compiled += 1
                used = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
                assert not used & others, (path, node.name)
    assert compiled > 5


def test_an_upgrade_shows_in_what_requires_it():
    found = digest.versions(["pandas", "yaml"])
    assert found["numpy"] == metadata.version("numpy")  # which pandas requires
    assert found["pyyaml"] == metadata.version("PyYAML")  # as it is called where it is installed
    assert "pyarrow" not in found  # which pandas may have
