# what earlier runs left: files that were lost are made again, damaged ones end the run
from galloping.reproducibility.failures import closing_line
from galloping.reproducibility.inspection import DamagedResults, lost, repair_command

LOST = []
if workflow.is_main_process:
    # a workflow that uses this one as a module has no `make`
    own = workflow.modifier.is_main_snakefile()
    try:
        missed = lost(RESULTS, repair_command(workflow.overwrite_configfiles) if own else None)
        LOST = [path for path in missed if any(rule.is_producer(path) for rule in workflow.rules)]
    except DamagedResults as error:
        sys.exit(str(error))
