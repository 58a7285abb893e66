"""The pages: built without a warning, their examples run, every link and image is there."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_pages_are_whole(tmp_path):
    build = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-d", tmp_path / "cache"]
    run = subprocess.run(
        [*build, ROOT / "docs", tmp_path / "pages"],
        env={"PATH": "/usr/bin:/bin", "PYTHONPATH": str(ROOT / "workflow/src")},
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stderr
    pages = sorted((tmp_path / "pages").glob("*.html"))
    assert len(pages) > 15
    for page in pages:
        for kind, target in re.findall(r'(href|src)="([^"#?]+)', page.read_text()):
            if target.startswith(("http", "mailto")):
                assert kind == "href", f"{page.name} loads {target}"
            else:
                assert (page.parent / target).exists(), f"{page.name}: {target}"
    summary = (tmp_path / "pages" / "tutorial_recording.html").read_text()
    assert "limit cycle" in summary
