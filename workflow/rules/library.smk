# The library, and a look at the settings before Snakemake reads them: it names no line of a mistake.
import os
import sys
from pathlib import Path

if isinstance(workflow.current_basedir, os.PathLike):  # a clone: its library is beside it
    LIBRARY = str(Path(workflow.current_basedir).parent / "src")
    sys.path.insert(0, LIBRARY)
    inherited = os.getenv("PYTHONPATH")
    os.environ.update(PYTHONPATH=f"{LIBRARY}{os.pathsep}{inherited}" if inherited else LIBRARY)

try:
    from galloping.configuration.load import ConfigurationError, load, merged, read
except ModuleNotFoundError as error:  # a workflow that was read from a host
    sys.exit(f"{error}: install the library of this workflow with pip, or use a clone")

CONFIGURATION = Path("config/config.yaml")
if CONFIGURATION.exists() or not config:  # a workflow that takes this one as a module has its own
    try:
        read(CONFIGURATION)
    except ConfigurationError as error:
        sys.exit(str(error))
