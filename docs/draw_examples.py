"""Pictures of the pages, as the commands on the pages draw them: `make docs` draws them again."""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
# options of `galloping identify`, and which file of its output the picture is; none: by `assess`
PICTURES = {
    "forecast": (("span.csv", "--map", "span.yaml"), "forecast.png"),
    "ambient": (("ambient.csv",), "fit.png"),
    "gusts": (("gusts.csv", "--map", "gusts.yaml"), None),
}


def draw(name: str, folder: Path) -> Path:
    """Draw a picture in an empty folder, by the commands of its page; return its path."""
    options, file = PICTURES[name]
    model = folder / name
    _galloping("identify", *options, "--output", model)
    if file:
        return model / file
    picture = folder / f"{name}.png"
    _galloping("assess", model / "model.json", "--at", "U=4:16:1", "--figure", picture)
    return picture


def _galloping(*arguments: str | Path) -> None:
    command = [sys.executable, "-m", "galloping", *map(str, arguments)]
    subprocess.run(command, cwd=EXAMPLES, check=True, capture_output=True)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        for name in PICTURES:
            shutil.copy(draw(name, Path(folder)), Path(sys.argv[1]) / f"{name}.png")
