"""The code digest changes with what a script runs, its libraries too, and with nothing else."""

import ast
import importlib
import sys
from importlib import metadata

import pytest

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
    monkeypatch.setattr(digest, "SOURCE", source)
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
    for cached in (digest.code, digest._parse, digest._find, digest._with_requirements,
                   digest._distribution):  # fmt: skip
        cached.cache_clear()
    importlib.invalidate_caches()


@pytest.mark.parametrize(
    ("name", "old", "new", "counts"),
    [
        ("stage.py", '"""Works."""', '"""Works hard."""', False),
        ("stage.py", '"""A stage."""\n', "", False),
        ("stage.py", "return 2 * LIMIT", "return 2 * LIMIT  # twice", False),
        ("stage.py", "return 2 * LIMIT", "return (\n        2 * LIMIT\n    )", False),
        ("script.py", '    """Works."""\n', "    # works\n", False),
        ("script.py", "work(sys.argv)", "work()", True),
        ("stage.py", "2 * LIMIT", "3 * LIMIT", True),
        ("stage.py", "return 2 * LIMIT", "text = '''words'''\n    return 2 * LIMIT", True),
        ("base.py", "ONE = 1", "ONE = 1.0", True),
        ("part/__init__.py", "", "import os\n", True),
    ],
)
def test_code_changes_the_digest_however_deep_and_words_do_not(package, name, old, new, counts):
    before = package()
    text = {"script.py": SCRIPT, **FILES}[name]
    assert old in text
    assert (package(name, text.replace(old, new)) != before) == counts


@pytest.mark.parametrize("name", ["part/page.jinja", "part/data.csv"])
def test_a_template_and_data_beside_a_module_count(package, name):
    package(name, "one")
    before = package()
    assert package(name, "two") != before


def test_what_runs_a_script_and_computes_nothing_does_not_count(package, monkeypatch):
    monkeypatch.setattr(digest, "UNCOUNTED", ("package.guard",))
    script = SCRIPT.replace("import sys\n", "import sys\nfrom package.guard import run\n")
    package("guard.py", "from package import other\n\nrun = 'no space left'\n")
    before = package("script.py", script)
    assert package("guard.py", "from package import other\n\nrun = 'the disk is full'\n") == before
    assert package("other.py", "OTHER = 2\n") == before
    assert package("base.py", "ONE = 2\n") != before


def test_a_misspelt_module_is_named(package):
    with pytest.raises(ValueError, match=r"package\.methods: no such module"):
        package(modules=["package.methods"])


def test_where_the_repository_lies_does_not_count(package, tmp_path, monkeypatch):
    before = package()
    moved = (tmp_path / "src").rename(tmp_path / "elsewhere")
    monkeypatch.setattr(digest, "SOURCE", moved)
    assert package() == before


def test_compiled_functions_use_no_other_module_of_the_package():
    # numba's cache of a function notices edits of its own file alone
    compiled = 0
    for path in (digest.SOURCE / digest.PACKAGE).rglob("*.py"):
        tree = ast.parse(path.read_text())
        others = {
            alias.asname or alias.name
            for node in tree.body
            if isinstance(node, ast.ImportFrom) and node.module.startswith(digest.PACKAGE)
            for alias in node.names
        }
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and any(
                "njit" in ast.unparse(decorator) for decorator in node.decorator_list
            ):
                compiled += 1
                used = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
                assert not used & others, (path, node.name)
    assert compiled > 5


# versions of libraries


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Pretends to install a distribution, before others on the path, and returns its folder."""
    monkeypatch.syspath_prepend(tmp_path)

    def install(name, version, *requirements):
        record = tmp_path / f"{name}-{version}.dist-info"
        record.mkdir()
        lines = [f"Name: {name}", f"Version: {version}"]
        lines += [f"Requires-Dist: {requirement}" for requirement in requirements]
        (record / "METADATA").write_text("\n".join(["Metadata-Version: 2.1", *lines, "", ""]))
        forget()
        return record

    yield install
    forget()


def test_an_upgrade_shows_in_what_requires_it(installed):
    installed("upper", "1.0", "lower>=1; python_version > '3'", "other; sys_platform == 'nowhere'")
    installed("lower", "1.1", "other; extra == 'test'")
    installed("other", "1.2")
    found = digest.versions(["upper"])
    del found["python"]
    assert found == {"lower": "1.1", "upper": "1.0"}


def test_every_import_of_the_project_is_found_by_its_distribution(root):
    files = [*(root / "workflow" / "src").rglob("*.py"), *(root / "workflow/scripts").glob("*.py")]
    nodes = [node for file in files for node in ast.walk(ast.parse(file.read_text()))]
    names = {a.name for node in nodes if isinstance(node, ast.Import) for a in node.names}
    names |= {node.module for node in nodes if isinstance(node, ast.ImportFrom)}
    tops = {name.partition(".")[0] for name in names} - sys.stdlib_module_names - {"galloping"}
    assert {"sklearn", "yaml", "numpy"} <= tops
    provided = metadata.packages_distributions()
    for name in tops:
        found = digest.versions([name])
        assert any(
            found.get(digest.canonicalize_name(distribution)) == metadata.version(distribution)
            for distribution in provided[name]
        ), name
