"""Where tables and figures look that cannot show all cells of a study."""

from __future__ import annotations

from collections.abc import Iterable

from galloping.identification.registry import Method
from galloping.measurement.protocols import STATES, Protocol
from galloping.study.cells import Case, Cell, Study
from galloping.study.kinds import NOISE, OURS, SUBSET

Pair = tuple[Protocol, Method]


def first_case(study: Study) -> Case:
    """Shown where one case has to do."""
    return study.cases[0]


def runs(pair: Pair) -> bool:
    """Whether a method can use whole records by a protocol."""
    protocol, method = pair
    return method.can_use(protocol, uniform=True)


def paper_pair(study: Study) -> Pair:
    """What shows one protocol and method shows the first that can run."""
    pairs = ((protocol, method) for method in study.methods for protocol in study.protocols)
    return next(filter(runs, pairs))


def sensor_protocol(study: Study) -> Protocol:
    """What a sensor gives, if the study has it."""
    sensors = (protocol for protocol in study.protocols if protocol.measures == STATES)
    return next(sensors, study.protocols[0])


def history_pairs(study: Study) -> list[Pair]:
    """What the paper did, and beside it what can be had from sensors."""
    pairs = [paper_pair(study)]
    ours = [(sensor_protocol(study), method) for method in study.methods if method.name == OURS]
    return pairs + [pair for pair in ours if pair not in pairs]


def claim_pairs(study: Study) -> list[Pair]:
    """Protocols that the paper's method can use, which needs velocities, by the paper's methods
    and ours.
    """
    _, first = paper_pair(study)
    methods = [m for m in study.methods if m in study.methods[:2] or m.name == OURS]
    protocols = [protocol for protocol in study.protocols if runs((protocol, first))]
    return [pair for protocol in protocols for m in methods if runs(pair := (protocol, m))]


def least_noise(study: Study, case: Case) -> Cell:
    """The whole record at the lowest level, as the paper's pair has it."""
    return _cells(study, case, paper_pair(study), NOISE)[0]


def noise_cells(study: Study, pair: Pair, wanted: Iterable[float]) -> list[Cell]:
    """Those of the wanted noise levels that the study has, else its three lowest above zero."""
    cells = [cell for cell in _cells(study, first_case(study), pair, NOISE) if cell.level > 0]
    return [cell for cell in cells if cell.level in wanted] or cells[:3]


def amount_cells(study: Study, pair: Pair) -> list[Cell]:
    """Subsets of the first case that a pair can use, the smallest first."""
    return _cells(study, first_case(study), pair, SUBSET)


def _cells(study: Study, case: Case, pair: Pair, kind: str) -> list[Cell]:
    protocol, method = pair
    cells = [
        cell
        for cell in study.cells
        if (cell.case, cell.protocol, cell.kind) == (case, protocol, kind)
        and method in cell.methods
    ]
    return sorted(cells, key=lambda cell: (cell.level, cell.samples))
