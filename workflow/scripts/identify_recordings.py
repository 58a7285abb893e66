"""What recordings from the field tell, as the command `galloping identify` says it."""

from pathlib import Path

from galloping.field.mapping import read_mapping
from galloping.field.study import Question, analyse, read_field
from galloping.reproducibility.job import run
from galloping.study.loading import load


def main() -> None:
    settings = snakemake.params.settings
    question = Question(
        settings["degree"], settings["method"], tuple(settings["known"]), settings["seed"]
    )
    folder = Path(snakemake.output[0]).parent
    read = load(settings["reads"], dict(snakemake.input.items()))
    beside = (settings["case"], read["model"].model) if "model" in read else None
    field = read_field(settings["files"], read_mapping(settings["mapping"]))
    analyse(field, question, folder, beside=beside)


run(main, snakemake)
