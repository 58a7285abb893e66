# what earlier runs left: files that were lost are made again, damaged ones end the run; and what
# this run leaves
from galloping.reproducibility.failures import closing_line
from galloping.reproducibility.inspection import DamagedResults, lost, make_command
from galloping.reproducibility.recovery import sweep

LOST = []
if workflow.is_main_process:
    # a workflow that uses this one as a module has no `make`
    own = workflow.modifier.is_main_snakefile()
    repair = make_command(workflow.overwrite_configfiles, "repair") if own else None
    try:
        LOST = lost(
            RESULTS, repair, lambda path: any(rule.is_producer(path) for rule in workflow.rules)
        )
    except DamagedResults as error:
        sys.exit(str(error))


def tidy():
    """Remove what killed jobs had not finished writing, and what would hold up Snakemake's exit."""
    for line in sweep(RESULTS):
        print(line, file=sys.stderr)
    cancel_timers()
