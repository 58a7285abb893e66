"""The code digest changes with the code that a script runs, and with nothing else."""

import pytest

from galloping.reproducibility import digest

SCRIPT = '''"""A script."""

from package.stage import work


work()
'''
FILES = {
    "__init__.py": '"""A package."""\n',
    "stage.py": '"""A stage."""\n\nfrom package.part.deep import LIMIT\n\n\ndef work():\n'
    '    """Works."""\n    return 2 * LIMIT\n',
    "part/__init__.py": "",
    "part/deep.py": "from package import base\n\nLIMIT = base.ONE\n",
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
    script.parent.mkdir()
    script.write_text(SCRIPT)

    def write(name=None, text=None, *, modules=()):
        if name:
            path = source / "package" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        digest._parse.cache_clear()  # as in another process
        return digest.code_digest(script, *modules)

    for name, text in FILES.items():
        write(name, text)
    yield write
    digest._parse.cache_clear()


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("stage.py", '"""Works."""', '"""Works hard."""'),
        ("stage.py", '    """Works."""\n', ""),
        ("stage.py", '"""A stage."""\n', ""),
        ("stage.py", "return 2 * LIMIT", "return 2 * LIMIT  # twice"),
        ("stage.py", "return 2 * LIMIT", "return (\n        2 * LIMIT\n    )"),
        ("part/deep.py", "LIMIT = base.ONE", "# one\nLIMIT = base.ONE"),
        ("base.py", "ONE = 1", '"""Base."""\n\nONE = 1'),
    ],
)
def test_words_do_not_change_the_digest(package, name, old, new):
    before = package()
    assert old in FILES[name]
    assert package(name, FILES[name].replace(old, new)) == before


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("stage.py", "2 * LIMIT", "3 * LIMIT"),
        ("stage.py", "return 2 * LIMIT", "text = '''words'''\n    return 2 * LIMIT"),
        ("part/deep.py", "base.ONE", "base.ONE + 1"),
        ("base.py", "ONE = 1", "ONE = 1.0"),
        ("__init__.py", '"""A package."""\n', "import os\n"),
        ("part/__init__.py", "", "import os\n"),
    ],
)
def test_code_changes_the_digest_however_deep(package, name, old, new):
    before = package()
    assert package(name, FILES[name].replace(old, new)) != before


def test_modules_that_a_script_does_not_use_do_not_count(package):
    before = package()
    assert package("other.py", "OTHER = 2\n") == before
    assert package("new.py", "NEW = 1\n") == before


def test_modules_imported_by_name_count_when_named(package):
    before = package(modules=["package.method"])
    assert before != package()
    assert package("other.py", "OTHER = 2\n", modules=["package.method"]) != before


def test_a_renamed_module_changes_the_digest(package):
    before = package()
    package("basis.py", FILES["base.py"])
    assert package("part/deep.py", FILES["part/deep.py"].replace("base", "basis")) != before


def test_a_misspelt_module_is_named(package):
    with pytest.raises(ValueError, match=r"package\.methods: no such module"):
        package(modules=["package.methods"])


def test_where_the_repository_lies_does_not_count(package, tmp_path, monkeypatch):
    before = package()
    moved = (tmp_path / "src").rename(tmp_path / "elsewhere")
    monkeypatch.setattr(digest, "SOURCE", moved)
    assert package() == before


def test_scripts_of_the_study_see_their_stages(root):
    scripts = root / "workflow" / "scripts"

    def used(*roots):
        paths = set().union(*(digest._closure(path) for path in roots))
        return {p.stem for p in paths if p.is_relative_to(digest.SOURCE)}

    derive = used(scripts / "derive_model.py")
    assert {"galerkin", "line", "aerodynamics", "storage"} <= derive
    assert not {"measurement", "simulation", "stlsq"} & derive
    assert not {"stlsq", "lasso", "claims"} & used(scripts / "identify_model.py")
    method = digest._find("galloping.identification.sparse.lasso")
    assert {"lasso", "selection"} <= used(scripts / "identify_model.py", method)
