"""Selection of study cells for tables and figures that cannot show all."""

from collections.abc import Iterable, Mapping
from functools import reduce
from itertools import product
from operator import getitem

from galloping.configuration.load import load, plain
from galloping.configuration.schema import child, leaves, schema
from galloping.configuration.settings import CaseSection, Settings, paper_cases
from galloping.fields import show
from galloping.identification.registry import Method
from galloping.recording.measurement import ALL_STATES, DERIVATIVES, Protocol
from galloping.results import (
    JOINT,
    MAIN_FAMILY,
    MAIN_METHOD,
    NOISE,
    PAPER_METHOD,
    PAPER_PROTOCOL,
    SUBSET,
)
from galloping.study.cells import Case, Cell, Study

Pair = tuple[Protocol, Method]
# settings of the whole study whose defaults the paper prints
PRINTED_SETTINGS = (
    "simulation.duration",
    "simulation.sampling_rate",
    "simulation.steady_window",
    "identification.degree",
)


def paper_pair(study: Study) -> Pair:
    """Return the paper's setup and method, or else the first pair that can use whole records."""
    every = product(study.methods, study.protocols)
    pairs = [(protocol, method) for method, protocol in every if method.can_use(protocol, True)]
    return next(filter(is_paper_pair, pairs), pairs[0])


def paper_method_in_words(study: Study) -> str:
    """Name the method of `paper_pair` as captions do."""
    name = paper_pair(study)[1].name
    return "the paper's method" if name == PAPER_METHOD else f"the method ``{name}``"


def is_paper_pair(pair: Pair) -> bool:
    """Decide whether a measurement setup and a method are those of the reproduced paper."""
    protocol, method = pair
    return (protocol.name, method.name) == (PAPER_PROTOCOL, PAPER_METHOD)


def departures(settings: Settings) -> dict[str, str]:
    """Give for each overhead line in the paper why the study cannot test claims about that line.

    The reason is "" if the study can: all that the paper prints of the line, the record and the
    library is unchanged. Other settings do not matter.
    """
    cases, study, papers = settings.cases, plain(settings), plain(load({}))
    changed = (_describe_change(key, study, papers) for key in PRINTED_SETTINGS)
    of_study = next(filter(None, changed), "")
    return {
        name: _describe_departure(cases.get(name), case) or of_study
        for name, case in paper_cases().items()
    }


def _describe_change(key: str, ours: Mapping, papers: Mapping) -> str:
    """Describe how the value at a dotted key differs from the paper's, "" if it does not."""
    value, paper_value = (reduce(getitem, key.split("."), values) for values in (ours, papers))
    if value == paper_value:
        return ""
    return f"{key} is {show(value)}, where the paper has {show(paper_value)}"


def _describe_departure(case: CaseSection | None, paper: CaseSection) -> str:
    if case is None:
        return "the study does not have it"
    if case.truth.model != "two_mode":
        return f"its recordings are those of a line that is {case.truth.model}"
    ours, papers = plain(case), plain(paper)
    for key, node in leaves(child(schema(), "cases")):
        key = key.partition(".")[2]  # below the name of the case
        if node.get("provenance") != "printed":
            continue
        paper_value = reduce(getitem, key.split("."), papers)
        # a case whose value differs from the default has one of ours, such as the second tension
        if paper_value == node["default"] and (change := _describe_change(key, ours, papers)):
            return change
    return ""


def judged_cases(study: Study) -> list[str]:
    """List the overhead lines about which the study can test the reproduced paper's claims."""
    return [name for name, departure in departures(study.settings).items() if not departure]


def departures_from_paper(study: Study) -> dict[str, str]:
    """Give for each overhead line why claims about it are not tested by the paper's own method.

    The reason is "" if they are; empty for a study without a case of the paper.
    """
    reasons = departures(study.settings)
    if not any(case.name in reasons for case in study.cases):
        return {}
    if not is_paper_pair(paper_pair(study)):
        reason = f"the study does not have {PAPER_METHOD} by protocol {PAPER_PROTOCOL}"
        return {name: departure or reason for name, departure in reasons.items()}
    return reasons


def sensor_protocol(study: Study) -> Protocol:
    """Return the measurement setup of a study that measures all states, or else its first setup."""
    sensors = (protocol for protocol in study.protocols if protocol.measures == ALL_STATES)
    return next(sensors, study.protocols[0])


def compared_fits(study: Study) -> list[tuple[Cell, Method]]:
    """List the recordings and methods whose identified equations the report puts side by side.

    They are the paper's method at the lowest noise level and at that of the subsets, and our method
    from sensors at the level of the subsets.
    """
    first, level = study.cases[0], study.settings.measurement.subsets.level
    of_paper = paper_pair(study)
    least = least_noise(study, first)
    fits = {(least.id, of_paper[1].name): (least, of_paper[1])}
    ours = [(sensor_protocol(study), m) for m in study.methods if m.name == MAIN_METHOD]
    for pair in (of_paper, *ours):
        cells = _cells_of_pair(study, first, pair, NOISE)
        fits |= {(c.id, pair[1].name): (c, pair[1]) for c in cells if c.level == level}
    return list(fits.values())


def least_noise(study: Study, case: Case) -> Cell:
    """Return the set of recordings with the lowest noise, for the paper's setup and method."""
    return _cells_of_pair(study, case, paper_pair(study), NOISE)[0]


def noise_cells(study: Study, pair: Pair, levels: Iterable[float]) -> list[Cell]:
    """List sets of recordings with wanted noise levels, or else the three lowest above zero."""
    cells = [cell for cell in _cells_of_pair(study, study.cases[0], pair, NOISE) if cell.level > 0]
    return [cell for cell in cells if cell.level in levels] or cells[:3]


def amount_cells(study: Study, pair: Pair) -> list[Cell]:
    """List the subsampled recordings of the first case that a pair can use, the shortest first."""
    return _cells_of_pair(study, study.cases[0], pair, SUBSET)


def assessed_cell(study: Study, case: str) -> Cell | None:
    """Choose the recordings whose models give the uncertainty of an engineering assessment.

    They are from sensors at the noise level of the subsets, and all recordings of the case together
    if it has several. None without our method, or for a continuous line.
    """
    cells = [
        cell
        for cell in _cells_at_subset_level(study, case)
        if cell.protocol == sensor_protocol(study) and cell.kind in (NOISE, JOINT)
    ]
    return max(cells, key=lambda cell: cell.recordings, default=None)


def predicted_cells(study: Study, case: str) -> dict[str, Cell]:
    """Choose the recordings whose models predict motions in other winds, by measurement setup.

    They are whole records of sensors at the noise level of the subsets that our method can use.
    None for a continuous line, whose motion at other wind speeds is unknown.
    """
    return {
        cell.protocol.name: cell
        for cell in _cells_at_subset_level(study, case)
        if cell.kind == NOISE and cell.protocol.measures != DERIVATIVES
    }


def predicting_methods(cell: Cell) -> list[str]:
    """List maximum likelihood, and the first method of the cell that is of another family."""
    others = [method.name for method in cell.methods if method.family != MAIN_FAMILY]
    return [MAIN_METHOD, *others[:1]]


def families_of(cell: Cell) -> list[str]:
    """List the families of the methods whose predictions are shown for a set of recordings."""
    names = predicting_methods(cell)
    return list(dict.fromkeys(m.family for m in cell.methods if m.name in names))


def ahead_cells(study: Study) -> list[Cell]:
    """List the whole records of the first case from which our method predicts the limit cycle."""
    return [cell for cell in _cells_of_our_method(study, study.cases[0]) if cell.kind == NOISE]


def oracle_cells(study: Study) -> list[Cell]:
    """List whole noisy records of all states, for which pysindy's best tuning is computed."""
    return [
        cell
        for cell in study.cells
        if cell.kind == NOISE and cell.level > 0 and cell.protocol.measures == ALL_STATES
        and not cell.case.is_continuous
        and any(method.family != MAIN_FAMILY for method in cell.methods)
    ]  # fmt: skip


def _cells_of_our_method(study: Study, case: Case) -> list[Cell]:
    """List the cells of a case that our method can use."""
    used = (cell for cell in study.cells if MAIN_METHOD in [method.name for method in cell.methods])
    return [cell for cell in used if cell.case == case]


def _cells_at_subset_level(study: Study, case: str) -> list[Cell]:
    """List cells at the noise level of the subsets; none of a continuous line."""
    line, level = study.case(case), study.settings.measurement.subsets.level
    cells = [] if line.is_continuous else _cells_of_our_method(study, line)
    return [cell for cell in cells if cell.level == level]


def _cells_of_pair(study: Study, case: Case, pair: Pair, kind: str) -> list[Cell]:
    protocol, method = pair
    cells = [
        cell
        for cell in study.cells
        if (cell.case, cell.protocol, cell.kind) == (case, protocol, kind)
        and method in cell.methods
    ]
    return sorted(cells, key=lambda cell: (cell.level, cell.samples))
