"""Takes the numbers of a finished study as the reference that later runs are compared with.

Usage: update_reference.py [--configfile FILE ...], on the machine that ran the study
Refuses a study in which anything is missing, damaged or not as configured.
"""

import argparse
import shutil
import sys
from dataclasses import asdict
from pathlib import Path

from galloping.reproducibility.plan import planning
from galloping.reproducibility.repair import audit
from galloping.storage import replacing, write_json
from galloping.tables.beside_reference import Origin, processor


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--configfile", nargs="+", default=[])
    plan = planning(parser.parse_args().configfile)
    results, reference = plan.results, Path(plan.settings["reference"])
    faults = plan.maker.keys() - set(audit(plan).sound)
    if any(reference.glob("*.csv")) and not (reference / "origin.json").exists():
        sys.exit(f"{reference}: holds tables of something else; must be a folder of its own")
    comparison = next(job for job in plan.jobs if job.rule == "compare_reference")
    if faults:
        sys.exit(
            f"{results}: {len(faults)} files are not finished as configured, such as "
            f"{min(faults)}; the reference is left as it was"
        )
    tables = [Path(path) for path in comparison.inputs if Path(path).is_relative_to(results)]
    tables = [path for path in tables if not path.is_relative_to(reference)]
    for gone in {path.name for path in reference.glob("*.csv")} - {path.name for path in tables}:
        (reference / gone).unlink()
    for path in tables:
        with replacing(reference / path.name) as partial:
            shutil.copyfile(path, partial)
    origin = Origin(settings=comparison.settings["study"]["study"], processor=processor())
    write_json(reference / "origin.json", asdict(origin))
    print(f"{reference}: {len(tables)} tables of {results} are the reference now")


if __name__ == "__main__":
    main()
