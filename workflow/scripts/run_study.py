"""Run the study, with one line that says why it cannot run or stops.

All further options are options of Snakemake.
"""

import argparse
import os
import re
import signal
import subprocess
import sys
import sysconfig
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from galloping.configuration.load import load_files, plain
from galloping.configuration.settings import Settings
from galloping.fields import list_first
from galloping.reproducibility.job import failures
from galloping.reproducibility.lock import (
    Killed,
    Obstacle,
    check_disk,
    clear_unfinished,
    end_in_one_line,
    end_orphans,
    locked,
    make_command,
    marked_environment,
)
from galloping.reproducibility.receipts import (
    Receipt,
    inspect,
    read_receipts,
    receipt_path,
    remember,
)
from galloping.study.cells import Study
from galloping.study.shown import departures_from_paper

WORKFLOW = Path(__file__).parents[1]
STEPS = re.compile(r"^(\d+) of (\d+) steps", re.MULTILINE)  # line of Snakemake after each job
ALL = re.compile(r"^all +1$", re.MULTILINE)  # row of rule `all` in its table of jobs

SNAKEMAKE_OUTPUT = Path("logs", "snakemake.txt")  # below the results, if stdout is no terminal
PROGRESS_INTERVAL = 60.0  # s: time between two lines of progress
LAST_LINES = 20  # lines of Snakemake's output that are shown if no log has a reason


def main(*arguments: str) -> int:
    """Run the study with command-line arguments, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument(
        "--repair",
        action="store_true",
        help="first make the study fit to continue after a kill, a crash, a manual edit or a lost "
        ".snakemake",
    )
    parser.add_argument(
        "--only",
        nargs="+",
        default=[],
        metavar="FILE",
        help="make these results and what they need, instead of the whole study",
    )
    flags, options = parser.parse_known_args(arguments)
    parser.add_argument("--configfile", nargs="+", default=[])
    parser.add_argument("--cores", nargs="?", const="")
    parser.add_argument("--workflow-profile")
    run_options, _ = parser.parse_known_args(options)
    check_cores(run_options.cores)
    check_python_path()
    files, repair = run_options.configfile, make_command(run_options.configfile, "repair")
    with end_in_one_line(repair):
        settings = load_files(["config/config.yaml", *files])
        results = settings.results
        with locked(results, repair, repairing=flags.repair) as began:
            if flags.repair:
                targets = repair_study(results, files)
            else:
                targets = check(results, files, repair)
            before, start = read_receipts(results), time.monotonic()
            for line in [] if flags.only else announce(settings, files, before, run_options):
                print(line, flush=True)
            status, interrupted = snakemake(results, *(flags.only or targets), *options)
            for line in clear_unfinished(results):
                print(line, file=sys.stderr)
            remember(results, inspect(results, after := read_receipts(results)))
            if interrupted and status:
                sys.exit("Interrupted. Finished jobs are kept; run it again to go on.")
            if not status:
                made = sum(before.get(path) != receipt for path, receipt in after.items())
                print_summary(settings, made, time.monotonic() - start)
                return 0
            check_disk(results)
            if reasons := "; ".join(failures(results, began)):
                text = f"The study stopped: {reasons}. Finished jobs are kept"
                print(f"{text}; run it again to go on.", file=sys.stderr)
            elif not sys.stdout.isatty():
                log = Path(results, SNAKEMAKE_OUTPUT)
                words = log.read_text(encoding="utf-8", errors="replace")
                last = [line for line in words.splitlines() if line.strip()][-LAST_LINES:]
                if "\nTraceback " in words:
                    last = [f"Snakemake stopped: {last[-1]} ({log}); `{repair}` may mend it"]
                print(*last, sep="\n", file=sys.stderr)
            return status


def announce(
    settings: Settings,
    configfiles: list[str],
    receipts: dict[str, Receipt],
    options: argparse.Namespace,
) -> Iterator[str]:
    """Yield lines on what a run will do, only warnings if nothing changed since the report."""
    report = f"{settings.results}/report.html"
    receipt = receipt_path(report)
    mtime = receipt.stat().st_mtime if receipt.exists() else 0.0
    before = receipts[report].settings.get("study") if report in receipts else None
    sources = [path for path in WORKFLOW.rglob("*") if path.is_file() and path.suffix != ".pyc"]
    sources += map(Path, ["config/config.yaml", *configfiles, sysconfig.get_path("purelib")])
    if before != {"study": plain(settings)} or any(
        path.stat().st_mtime > mtime for path in sources
    ):
        from galloping.reproducibility.plan import describe_run, make_plan  # slow: Snakemake

        cores = int(options.cores) if str(options.cores).isdecimal() else os.cpu_count()
        yield from describe_run(
            make_plan(configfiles), receipts, None if options.workflow_profile else cores
        )
    else:
        yield from Study(settings).doubts


def print_summary(settings: Settings, n_files: int, seconds: float) -> None:
    """Print a summary of a run: new results, reproduced claims, and the path of the report."""
    from galloping.reproducibility.plan import duration_in_words

    results = settings.results
    files = f"{n_files} file{'s' * (n_files > 1)} made in {duration_in_words(seconds)}"
    print(f"{files}: {results}" if n_files else "Nothing to do: all results are as configured.")
    report, table = Path(results, "report.html"), Path(results, "tables", "paper.csv")
    # without a case of the paper, the table is of an earlier study
    if table.exists() and departures_from_paper(Study(settings)):
        import pandas as pd

        from galloping.report.printed_numbers import describe_counts

        print(describe_counts(pd.read_csv(table)))
    if report.exists():
        print(f"Report: {report}")


def check_cores(text: str | None) -> None:
    """Exit with a message if a text is not a number of cores that Snakemake accepts."""
    if text not in (None, "all") and not (text.isdecimal() and int(text) > 0):
        sys.exit(f"CORES: {text!r} is not a number of cores; must be all or a whole number >= 1")


def check_python_path() -> None:
    """Exit with a message if Snakemake cannot start jobs: it passes this path to bash unquoted."""
    if re.search(r"[^\w@%+=:,./~-]", sys.executable):
        sys.exit(
            f"{sys.executable}: Snakemake cannot start jobs with a Python whose path has a space, "
            "bracket or other special character: use a Python environment in a path without"
        )


def check(results: str, configfiles: list[str], repair: str) -> list[str]:
    """Return missing results as targets for Snakemake; raise Obstacle if one is damaged."""
    findings = inspect(results, read_receipts(results))
    for fault, paths in {
        "edited or damaged since its job wrote it": findings.damaged,
        "no receipt says how it was made": findings.unrecorded,
    }.items():
        if paths:
            cure = f"`{repair}` sets it aside and makes it again"
            raise Obstacle(f"{list_first(paths)}: {fault}; {cure}")
    targets: list[str] = []
    if findings.unseen or findings.missing:
        from galloping.reproducibility.plan import find_recorded, make_plan  # slow: Snakemake

        planned = make_plan(configfiles).maker
        if unrecorded := (set(findings.unseen) & planned.keys()) - find_recorded(configfiles):
            raise Obstacle(
                f"{results}: Snakemake's records of {len(unrecorded)} files (.snakemake) are gone, "
                f"with them what was edited since; `{repair}` compares the receipts instead"
            )
        missing = tuple(path for path in findings.missing if path in planned)
        findings = replace(findings, missing=missing)  # unplanned files are forgotten
        targets = ["all", *missing] if missing else []
    remember(results, findings)
    return targets


def repair_study(results: str, configfiles: list[str]) -> list[str]:
    """Repair a study after a crash or an edit, print what was done, return targets as `check`."""
    from galloping.reproducibility.plan import find_recorded, make_plan, unlock
    from galloping.reproducibility.repair import adopt, set_aside

    if ended := end_orphans(results):
        print(f"ended {ended} jobs that a killed run had left running")
    unlock(configfiles)
    for line in clear_unfinished(results):
        print(line)
    receipts = read_receipts(results)
    findings, plan = inspect(results, receipts, thorough=True), make_plan(configfiles)
    for path in findings.damaged:
        print(f"{path} was edited or damaged: set aside as {set_aside(results, path)}")
    unknown = [path for path in plan.maker if path not in receipts and Path(path).exists()]
    for path in unknown:
        print(f"{path} has no receipt that can be read: set aside as {set_aside(results, path)}")
    if (set(findings.unseen) & plan.maker.keys()) - find_recorded(configfiles):
        print(*adopt(plan), sep="\n", flush=True)
        receipts = read_receipts(results)
    findings = inspect(results, receipts)
    remember(results, findings)
    return ["all", *unknown, *(path for path in findings.missing if path in plan.maker)]


def snakemake(results: str, *arguments: str) -> tuple[int, bool]:
    """Run Snakemake, and return its exit code and whether the user interrupted it.

    On a terminal Snakemake shows progress bars; elsewhere its output goes to a file, and one line
    per minute reports the progress. Raises Killed if a signal ended it.
    """
    interrupts = []
    # Ctrl-C goes to Snakemake and its jobs as well: wait until they have ended.
    signal.signal(signal.SIGINT, lambda *_: interrupts.append(True))
    command = [sys.executable, "-m", "snakemake", *arguments]
    environment = marked_environment(results)
    if sys.stdout.isatty():
        status = subprocess.Popen([*command, "--logger", "rich"], env=environment).wait()
    else:
        log = Path(results, SNAKEMAKE_OUTPUT)
        log.parent.mkdir(parents=True, exist_ok=True)
        with log.open("w", encoding="utf-8") as file:
            process = subprocess.Popen(command, env=environment, stdout=file, stderr=file)
            status = follow(process, log)
    if status < 0 and not interrupts:
        raise Killed
    return status, bool(interrupts)


def follow(process: subprocess.Popen, log: Path) -> int:
    """Wait for a Snakemake process, print its progress every minute, return its exit code."""
    last_line = ""
    while True:
        try:
            return process.wait(PROGRESS_INTERVAL)
        except subprocess.TimeoutExpired:
            text = log.read_text(encoding="utf-8", errors="replace")
            line = ""
            if done := STEPS.findall(text):
                count, total = map(int, done[-1])
                jobs = total - len(ALL.findall(text))
                line = f"{min(count, jobs)} of {jobs} jobs done"
            if line != last_line:
                last_line = line
                print(line, flush=True)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
