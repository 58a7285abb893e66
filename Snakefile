# The study of the paper, end to end. Stages: workflow/rules; settings: config/README.md.
from snakemake.utils import min_version

min_version("9.0")


configfile: "config/config.yaml"


report: "workflow/report/workflow.rst"


include: "workflow/rules/common.smk"
include: "workflow/rules/shown.smk"
include: "workflow/rules/derive.smk"
include: "workflow/rules/simulate.smk"
include: "workflow/rules/measure.smk"
include: "workflow/rules/identify.smk"
include: "workflow/rules/bound.smk"
include: "workflow/rules/evaluate.smk"
include: "workflow/rules/tabulate.smk"
include: "workflow/rules/draw.smk"
include: "workflow/rules/check.smk"


rule all:
    default_target: True
    input:
        tables(),
        figures(),
        LOST,


onsuccess:
    cancel_timers()


onerror:
    print(closing_line(log), file=sys.stderr)
    cancel_timers()
