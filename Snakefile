# Here for plain `snakemake`, which looks for profiles beside it; the study is workflow/Snakefile,
# where other workflows and the workflow catalogue look. `include:` would lose the default target.
workflow.include("workflow/Snakefile", overwrite_default_target=True)
