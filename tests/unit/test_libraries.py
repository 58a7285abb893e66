"""Versions of libraries count for what uses them, wherever and however they are installed."""

import ast
import importlib
import sys
from importlib import metadata

import pytest

from galloping.reproducibility import digest


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


def forget():
    """As in another process."""
    for cached in (digest._with_requirements, digest._distribution):
        cached.cache_clear()
    importlib.invalidate_caches()


def test_versions_are_those_of_a_library_and_all_that_it_requires():
    found = digest.versions(["pysindy"])
    assert {"pysindy", "scikit-learn", "scipy", "numpy"} <= set(found)
    assert all(found[name] == metadata.version(name) for name in set(found) - {"python"})
    assert found["python"] == f"{sys.version_info.major}.{sys.version_info.minor}"
    assert not {"matplotlib", "pytest", "snakemake"} & set(found)
    assert "matplotlib" not in digest.versions(["numpy", "scipy", "numba", "heyoka", "sklearn"])


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
