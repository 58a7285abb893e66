"""Where tables and figures look that cannot show all cells of a study."""

from collections.abc import Iterable
from functools import reduce
from operator import getitem

from galloping.configuration.load import plain
from galloping.configuration.schema import child, leaves, schema
from galloping.configuration.settings import CaseSection, Settings, paper_cases
from galloping.fields import show
from galloping.identification.registry import Method
from galloping.recording.measurement import ALL_STATES, DERIVATIVES, Protocol
from galloping.results import JOINT, NOISE, OURS, OURS_FAMILY, PAPER_METHOD, PAPER_PROTOCOL, SUBSET
from galloping.study.cells import Case, Cell, Study

Pair = tuple[Protocol, Method]


def runs(pair: Pair) -> bool:
    """Whether a method can use whole records by a protocol."""
    protocol, method = pair
    return method.can_use(protocol, uniform=True)


def paper_pair(study: Study) -> Pair:
    """Return the paper's protocol and method, or the first pair that a study can run."""
    pairs = list(
        filter(runs, ((protocol, m) for m in study.methods for protocol in study.protocols))
    )
    papers = (pair for pair in pairs if is_papers(pair))
    return next(papers, pairs[0])


def is_papers(pair: Pair) -> bool:
    """Whether it is how the paper measured and identified."""
    protocol, method = pair
    return (protocol.name, method.name) == (PAPER_PROTOCOL, PAPER_METHOD)


def departures(settings: Settings) -> dict[str, str]:
    """Why the paper's claims about each of its cases cannot be judged in a study; "" where they
    can: what the paper prints of the line is unchanged, whatever the rest is.
    """
    cases = settings.cases
    return {
        name: _describe_departure(cases.get(name), case) for name, case in paper_cases().items()
    }


def _describe_departure(case: CaseSection | None, paper: CaseSection) -> str:
    if case is None:
        return "the study does not have it"
    if case.truth.model != "two_mode":
        return f"its recordings are those of a line that is {case.truth.model}"
    ours, papers = plain(case), plain(paper)
    for key, node in leaves(child(schema(), "cases")):
        path = key.split(".")[1:]  # below the name of the case
        if node.get("provenance") != "seed":
            continue
        value, printed = (reduce(getitem, path, values) for values in (ours, papers))
        # where the paper's own case has another value it is ours, as the tension of the second line
        if printed == node["default"] and value != printed:
            return f"{'.'.join(path)} is {show(value)}, where the paper has {show(printed)}"
    return ""


def judged_cases(study: Study) -> list[str]:
    """Names of the cases about which the paper's claims can be judged."""
    return [name for name, departure in departures(study.settings).items() if not departure]


def departures_from_paper(study: Study) -> dict[str, str]:
    """Why the paper's claims about its cases are not judged by its own method, "" where they are;
    empty for a study without a case of the paper.
    """
    found = departures(study.settings)
    if not any(case.name in found for case in study.cases):
        return {}
    if not is_papers(paper_pair(study)):
        lacking = f"the study does not have {PAPER_METHOD} by protocol {PAPER_PROTOCOL}"
        return {name: departure or lacking for name, departure in found.items()}
    return found


def sensor_protocol(study: Study) -> Protocol:
    """Return what a sensor gives, if the study has it."""
    sensors = (protocol for protocol in study.protocols if protocol.measures == ALL_STATES)
    return next(sensors, study.protocols[0])


def equations_beside(study: Study) -> list[tuple[Cell, Method]]:
    """Whole records of the first case, and what identified them, whose equations are set side by
    side: the paper's pair at the lowest noise level and at that of the subsets, and ours from
    sensors at the latter.
    """
    first, level = study.cases[0], study.settings.measurement.subsets.level
    papers = paper_pair(study)
    found = {least_noise(study, first).id: (least_noise(study, first), papers[1])}
    ours = [(sensor_protocol(study), m) for m in study.methods if m.name == OURS]
    for pair in (papers, *ours):
        cells = _cells_of_pair(study, first, pair, NOISE)
        found |= {cell.id: (cell, pair[1]) for cell in cells if cell.level == level}
    return list(found.values())


def least_noise(study: Study, case: Case) -> Cell:
    """Return the whole record at the lowest level, as the paper's pair has it."""
    return _cells_of_pair(study, case, paper_pair(study), NOISE)[0]


def noise_cells(study: Study, pair: Pair, wanted: Iterable[float]) -> list[Cell]:
    """Those of the wanted noise levels that the study has, else its three lowest above zero."""
    cells = [cell for cell in _cells_of_pair(study, study.cases[0], pair, NOISE) if cell.level > 0]
    return [cell for cell in cells if cell.level in wanted] or cells[:3]


def amount_cells(study: Study, pair: Pair) -> list[Cell]:
    """Subsets of the first case that a pair can use, the smallest first."""
    return _cells_of_pair(study, study.cases[0], pair, SUBSET)


def assessed_cell(study: Study, case: str) -> Cell | None:
    """Whose models say how sure an assessment is: sensors at the level of the subsets, all
    recordings of the case together where it has several; None where ours does not run, or models
    are not the line's own.
    """
    chosen = [
        cell
        for cell in _at_one_level(study, case)
        if cell.protocol == sensor_protocol(study) and cell.kind in (NOISE, JOINT)
    ]
    return max(chosen, key=lambda cell: cell.recordings, default=None)


def predicted_cells(study: Study, case: str) -> dict[str, Cell]:
    """Whole records of sensors at the level of the subsets, by protocol, that ours can use; none
    of a continuous line, whose motion at other wind speeds is not known.
    """
    return {
        cell.protocol.name: cell
        for cell in _at_one_level(study, case)
        if cell.kind == NOISE and cell.protocol.measures != DERIVATIVES
    }


def predicting_methods(cell: Cell) -> list[str]:
    """Ours, and the first other method beside it."""
    others = [method.name for method in cell.methods if method.family != OURS_FAMILY]
    return [OURS, *others[:1]]


def families_of(cell: Cell) -> list[str]:
    """Of the methods that predict."""
    names = predicting_methods(cell)
    return list(dict.fromkeys(m.family for m in cell.methods if m.name in names))


def ahead_cells(study: Study) -> list[Cell]:
    """Whole records of the first case that ours can use."""
    return [cell for cell in _own_cells(study, study.cases[0]) if cell.kind == NOISE]


def oracle_cells(study: Study) -> list[Cell]:
    """Whole noisy records of all states that a method of pysindy is tuned on."""
    return [
        cell
        for cell in study.cells
        if cell.kind == NOISE and cell.level > 0 and cell.protocol.measures == ALL_STATES
        and not cell.case.is_continuous
        and any(method.family != OURS_FAMILY for method in cell.methods)
    ]  # fmt: skip


def _own_cells(study: Study, case: Case) -> list[Cell]:
    """Return the cells of a case that ours can use."""
    used = (cell for cell in study.cells if OURS in [method.name for method in cell.methods])
    return [cell for cell in used if cell.case == case]


def _at_one_level(study: Study, case: str) -> list[Cell]:
    """Those at the noise level of the subsets; none of a continuous line."""
    of, level = study.case(case), study.settings.measurement.subsets.level
    return [c for c in _own_cells(study, of) if c.level == level and not of.is_continuous]


def _cells_of_pair(study: Study, case: Case, pair: Pair, kind: str) -> list[Cell]:
    protocol, method = pair
    cells = [
        cell
        for cell in study.cells
        if (cell.case, cell.protocol, cell.kind) == (case, protocol, kind)
        and method in cell.methods
    ]
    return sorted(cells, key=lambda cell: (cell.level, cell.samples))
