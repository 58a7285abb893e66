"""Identification of all noise realisations of a study cell by a family of methods.

A realisation without a model is a row with the reason. Jobs that only read models import
`identified_model`, and not this module, so that they need not run again after an edit here.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import cache, partial
from pkgutil import resolve_name

from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.no_model import NO_MODEL_ERRORS, as_findings
from galloping.model.functions import n_exponents
from galloping.model.polynomial import Exponents
from galloping.recording.samples import Recording
from galloping.streams import make_generator


def identify(
    methods: Mapping[str, Mapping],
    replicates: Iterable[Sequence[Recording]],
    terms: tuple[Exponents, ...],
    name: Sequence[str],
) -> dict[str, list[IdentifiedModel]]:
    """Identify a model from each noise realisation with each method; return lists by method.

    methods: `Method.settings` by name. replicates: the recordings of each, which share one model.
    terms: of the candidate library. name: of the cell, for random numbers. Methods that use the
    same regression problems share them. A mistake in a call or in the code is raised, and is no
    row.
    """
    models: dict[str, list[IdentifiedModel]] = {method: [] for method in methods}
    for replicate, recordings in enumerate(replicates):
        evidence = cache(partial(_make_evidence, recordings, terms))
        for method, settings in methods.items():
            options = dict(settings["options"])
            if settings["seed"] is not None:
                options["rng"] = make_generator(
                    settings["seed"], "identification", *name, method, replicate
                )
            try:
                method_function = resolve_name(settings["function"])
                model = method_function(evidence(settings["evidence"]), **options)
            except NO_MODEL_ERRORS as error:
                states, inputs = recordings[0].states, tuple(recordings[0].inputs)
                inputs = inputs[: n_exponents(terms[0]) - len(states)]
                model = IdentifiedModel.refused(states, terms, as_findings(error), inputs)
            models[method].append(model)
    return models


def _make_evidence(
    recordings: Sequence[Recording], terms: tuple[Exponents, ...], maker: str | None
) -> object:
    """Make the regression problems that methods use (see `registry.Method`)."""
    return resolve_name(maker)(recordings, terms) if maker else recordings
