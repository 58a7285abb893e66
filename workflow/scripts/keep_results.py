"""Verify, archive, restore and prune the results of a finished study, for the Makefile.

Usage: keep_results.py COMMAND [OPTIONS] [--configfile FILE ...]
"""

import argparse
import shutil
import sys
import tempfile
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

import pandas as pd

from galloping.configuration.load import load_files, plain
from galloping.publication.archive import (
    NotRestorable,
    check_digest,
    describe_changed_settings,
    find_faults,
    read_published_settings,
    unpack,
)
from galloping.publication.archive import restore as restore_archive
from galloping.publication.publishing import ALLOWABLE_OBSTACLES, NotPublishable, note_on_report
from galloping.publication.publishing import publish as publish_study
from galloping.reproducibility.lock import check_places, end_in_one_line, locked, make_command
from galloping.reproducibility.plan import make_plan
from galloping.reproducibility.receipts import digest, inspect, read_receipts, remember
from galloping.reproducibility.repair import audit, remove
from galloping.storage import replacing, write_json
from galloping.tables.comparison import Origin, describe_processor, list_differences, list_tables

FAULTS = {
    "damaged": "not what its job wrote: `{repair}` makes it again",
    "missing": "not here: `{run}` makes it",
    "outdated": "made with other settings, code or inputs: `{run}` makes it again",
    "unknown": "has no receipt that can be read: `{repair}` makes it again",
}


def main() -> None:
    """Run the command that the command line names, such as verify, publish or restore."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(required=True)
    for function, *options in (
        (verify,),
        (verify_archive, "archive", "--sha256"),
        (publish, "--allow"),
        (restore, "archive", "--replace", "--sha256"),
        (prune, "--delete"),
        (take_reference,),
    ):
        command = commands.add_parser(function.__name__, help=function.__doc__)
        command.set_defaults(run=function)
        for name in options:
            is_flag = name in ("--replace", "--delete")
            command.add_argument(name, **({"action": "store_true"} if is_flag else {}))
        command.add_argument("--configfile", nargs="+", default=[])
    args = vars(parser.parse_args())
    with end_in_one_line():
        settings = load_files(["config/config.yaml", *args["configfile"]])
        check_places(settings.results)  # before Snakemake, whose messages are less clear
        args.pop("run")(**args)


@contextmanager
def locked_plan(configfile):
    """Plan a study, and lock it against other processes in a `with` block."""
    plan = make_plan(configfile)
    with locked(plan.results, make_command(configfile, "repair")):
        yield plan


def verify(configfile):
    """Check that all result files of a study are intact, up to date and made as configured."""
    run, repair = make_command(configfile), make_command(configfile, "repair")
    plan = make_plan(configfile)
    checked, count = audit(plan), 0
    for state, meaning in FAULTS.items():
        for path in getattr(checked, state):
            print(f"{path}: {meaning.format(run=run, repair=repair)}")
            count += 1
    print(f"{plan.results}: {len(checked.sound)} files verified, {count} at fault")
    if checked.elsewhere:
        print(f"{len(checked.elsewhere)} files are not here: the archive restored from has none")
    if checked.left_over:
        print(f"{len(checked.left_over)} files are no longer asked for: see `make prune`")
    sys.exit(count > 0)


def verify_archive(archive, sha256, configfile):
    """Check that an archive is intact and the published one, and compare it with this study."""
    try:
        with tempfile.TemporaryDirectory() as folder:
            present = check_digest(archive, sha256)
            unpack(archive, Path(folder))
            if lines := list(find_faults(Path(folder))):
                raise NotRestorable("\n".join(lines))
            print(f"{archive}: every file is as in its manifest; SHA-256 {present}")
            if not sha256:
                print("Compare it with the published SHA-256, or give that: SHA256=...")
            compare(Path(folder), plain(load_files(["config/config.yaml", *configfile])))
    except NotRestorable as error:
        sys.exit(f"{error}\n{archive}: not as it was published")


def compare(folder: Path, study: dict) -> None:
    """Compare an unpacked archive with the study of this folder; exit with 1 if numbers differ."""
    results, before = study["results"], read_published_settings(folder)
    if not list_tables(Path(results)):
        print(f"{results}: no study here, so that no numbers were compared")
        return
    for line in describe_changed_settings(before, study):
        print(f"Other settings: {line}")
    lines = list(list_differences(folder / before["results"], results))
    print(*lines, f"{results}: {'differs from' if lines else 'agrees with'} the archive", sep="\n")
    sys.exit(bool(lines))


def publish(allow, configfile):
    """Write a folder and an archive with which a finished study can be published."""
    allowed = allow.split(",") if allow else []
    if unknown := [kind for kind in allowed if kind not in ALLOWABLE_OBSTACLES]:
        sys.exit(
            f"ALLOW: {unknown[0]!r} is not allowed; must be of {', '.join(ALLOWABLE_OBSTACLES)}"
        )
    try:
        with locked_plan(configfile) as plan:
            archive, note = publish_study(plan, allowed), note_on_report(plan)
    except NotPublishable as error:
        sys.exit(
            f"{error}\nNot published. Commit what is dirty; `{make_command(configfile)}` completes "
            f"the study, `{make_command(configfile, 'repair')}` mends it; "
            f"ALLOW={','.join(ALLOWABLE_OBSTACLES)} publishes all the same and records it."
        )
    print(f"{archive}: {archive.stat().st_size / 1e6:.1f} MB, SHA-256 {digest(archive)}")
    if note:
        print(note)
    print("Publish this SHA-256 elsewhere than the archive: by it alone others know its numbers.")


def restore(archive, replace, sha256, configfile):
    """Put the results of a published archive into this study, instead of computing them."""
    try:
        with locked_plan(configfile) as plan:
            check_digest(archive, sha256)
            for line in restore_archive(Path(archive), plan, replacing=replace):
                print(line)
            remember(plan.results, inspect(plan.results, read_receipts(plan.results)))
    except NotRestorable as error:
        sys.exit(f"{error}\nNothing was restored.")
    except OSError as error:
        sys.exit(f"{error}: when this is mended, restore again")


def prune(delete, configfile):
    """List or delete result files that the present settings no longer need."""
    with locked_plan(configfile) as plan:
        left_over = audit(plan).left_over
        for receipt in left_over:
            print(*(remove(receipt) if delete else [receipt.path]))
    if not left_over:
        print(f"{plan.results}: nothing is left over; the settings ask for every result")
        return
    size = sum(receipt.size for receipt in left_over) / 1e6
    done = "removed" if delete else "to be removed by DELETE=yes"
    print(f"{plan.results}: {len(left_over)} left over files, {size:.1f} MB, {done}")


def take_reference(configfile):
    """Copy the tables of a finished study as the reference of later comparisons.

    Refuses a study in which anything is missing, damaged or not as configured.
    """
    plan = make_plan(configfile)
    results, reference = plan.results, Path(plan.settings["reference"])
    if any(reference.glob("*.csv")) and not (reference / "origin.json").exists():
        sys.exit(f"{reference}: holds tables of something else; must be a folder of its own")
    comparison = next(job for job in plan.jobs if job.rule == "compare_reference")
    if unfinished := plan.maker.keys() - set(audit(plan).sound):
        sys.exit(
            f"{results}: {len(unfinished)} files are not finished as configured, such as "
            f"{min(unfinished)}; the reference is left as it was"
        )
    tables = [Path(path) for path in comparison.inputs if Path(path).is_relative_to(results)]
    tables = [path for path in tables if not path.is_relative_to(reference)]
    for name in {path.name for path in reference.glob("*.csv")} - {path.name for path in tables}:
        (reference / name).unlink()
    for path in tables:
        with replacing(reference / path.name) as partial:
            shutil.copyfile(path, partial)
    measured = Path(results, "benchmarks").rglob("*.tsv")  # what each job took, by Snakemake
    seconds = sum(float(pd.read_csv(path, sep="\t")["cpu_time"].sum()) for path in measured)
    study = comparison.settings["study"]["study"]
    origin = Origin(study, describe_processor(), core_minutes=round(seconds / 60, 1))
    write_json(reference / "origin.json", asdict(origin))
    print(f"{reference}: {len(tables)} tables of {results} are the reference now")


if __name__ == "__main__":
    main()
