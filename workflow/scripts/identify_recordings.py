"""Analysis of field recordings, as by the command `galloping identify`."""

from pathlib import Path

from galloping.readers.mapping import read_mapping
from galloping.reproducibility.job import run
from galloping.study.files import read_model
from galloping.summary.analysis import FieldQuestion, analyse, read_field


def identify_recordings(files, mapping, beside, made, question, case):
    """Identify a model from field recordings; write the model, a summary and figures."""
    question = FieldQuestion(**{**question, "known": tuple(question["known"])})
    line = (case, read_model(beside).model) if beside else None
    field = read_field(files, read_mapping(mapping))
    analyse(field, question, Path(made[0]).parent, beside=line)


if __name__ == "__main__":
    run(identify_recordings, snakemake)
