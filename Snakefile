# What plain `snakemake` finds first. An `include:` would lose the default target.
workflow.include("workflow/Snakefile", overwrite_default_target=True)
