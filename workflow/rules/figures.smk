# models, motions, tables -> figures
#
# A figure: its label in the report, and how it is made, as a table is (tables.smk).
from galloping.deferred import figures  # the jobs import it
from galloping.results import BOUND, NOISE, SUBSET

COEFFICIENT_LEVELS = (0.01, 0.03, 0.05)
HISTORY_LEVELS = (0.05, 0.1, 0.15)
OPEN_LABELS = {
    "wind_speed": "wind, m/s",
    "damping_vertical": "$\\zeta_v$",
    "damping_horizontal": "$\\zeta_w$",
    "bundle_dimension": "$D$, m",
    "release_vertical": "$q_v(0)$, m",
    "release_horizontal": "$q_w(0)$, m",
    "threshold": "threshold",
}


def table_of(name):
    return f"<results>/tables/{name}.csv"


def unit(protocol):
    """Of its noise levels."""
    return protocol.noise_unit(STUDY.settings.measurement.state_noise == "relative")


def names(pair):
    protocol, method = pair
    return {"protocol": protocol.name, "method": method.name}


def against_noise(*quantities):
    """Scores of whole records."""
    labels = {p.name: f"noise level, {unit(p)}" for p in STUDY.protocols}
    return {"kind": NOISE, "x": "level", "labels": labels, "quantities": list(quantities)}


def against_points(*quantities):
    """Scores of random samples."""
    labels = {p.name: "points" for p in STUDY.protocols}
    return {"kind": SUBSET, "x": "points", "labels": labels, "quantities": list(quantities)}


def noisy_histories(pair):
    """Time histories at several noise levels: the cells, each with its label."""
    cells = shown.noise_cells(STUDY, shown.paper_pair(STUDY), HISTORY_LEVELS)
    return {each.name: f"noise level {each.level:g} ({unit(pair[0])})" for each in cells}


def sampled_histories(pair):
    """The same by amount of data, in the paper's order."""
    cells = reversed(shown.amount_cells(STUDY, shown.paper_pair(STUDY)))
    return {each.name: f"{each.samples} points" for each in cells}


def figure(label, function, settings=None, **reads):
    """How a figure is made. label: in the report."""
    return SimpleNamespace(label=label, **vars(made(function, settings, **reads)))


def histories(number, what, cells_of):
    """Time histories of the first case, by the paper's method and by ours where the study has it.

    cells_of: the labels of the cells of a protocol and a method, by name.
    """
    by = {f"figure{number}": (f"{number} {what}", shown.paper_pair(STUDY))}
    if shown.has_ours(STUDY):
        by[f"figure{number}_methods"] = f"{number}, our method: {what}", shown.our_pair(STUDY)
    found = {}
    for name, (label, pair) in by.items():
        cells = {f"{FIRST}/{pair[0].name}/{cell}": text for cell, text in cells_of(pair).items()}
        found[name] = figure(
            label,
            figures.motions.draw_histories,
            {"case": FIRST, **names(pair), "cells": cells, "window": WINDOW},
            trajectory=TRAJECTORY,
            reconstructions=every("<results>/reconstructions/{cell}.npz", cell=cells),
        )
    return found


FIGURES = {}
if DEPARTURES:
    FIGURES["printed"] = figure(
        "the paper's printed numbers beside ours",
        figures.against_paper.draw_printed,
        {"case": next(iter(DEPARTURES))},
        table=table_of("paper"),
    )
if LINES:
    first_line = {"case": FIRST, "line": first_case.line}
    by_paper = shown.paper_pair(STUDY)
    papers = {"case": FIRST, **names(by_paper)}  # the paper's method on the first case
    draws = {"table": SCORES}  # its scores, and its many draws where the study has them
    if shown.is_papers(by_paper) and FIRST in REDRAWN:
        draws["draws"] = f"<results>/paper/{FIRST}.csv"
    everything = {  # in the study's order
        "cases": LINES,
        "protocols": [protocol.name for protocol in STUDY.protocols],
        "methods": [*(method.name for method in STUDY.methods), BOUND],
    }
    noisy_cells = {}  # without noise, and where no coefficients are true, there are none to show
    if not first_case.is_continuous:
        chosen = shown.noise_cells(STUDY, by_paper, COEFFICIENT_LEVELS)
        noisy_cells = {each.name: each.level for each in chosen}
    coefficients_at = f"<results>/identified/{FIRST}/{by_paper[0].name}"
    levels, points = STUDY.settings.measurement.levels, STUDY.settings.measurement.subsets.points
    sensors, noise_labels = shown.sensor_protocol(STUDY), against_noise()["labels"]
    predicted = shown.predicted_cells(STUDY, FIRST)
    predicting = [shown.predicting_methods(each) for each in predicted.values()][:1] or [[""]]
    FIGURES |= {
        "figure01": figure(
            "01 line and coordinates", figures.schematics.draw_line, first_line, model=MODEL
        ),
        "figure02": figure(
            "02 aerodynamic load",
            figures.schematics.draw_aerodynamic_load,
            first_line,
            trajectory=TRAJECTORY,
        ),
        "figure03": figure(
            "03 flow chart",
            figures.schematics.draw_flow,
            {
                "degree": DEGREE,
                "protocols": everything["protocols"],
                "methods": everything["methods"][:-1],
                "levels": [min(levels), max(levels)],
                "points": [min(points), max(points)],
                "replicates": STUDY.settings.measurement.replicates,
            },
        ),
        "figure04": figure(
            "04 motion without noise",
            figures.motions.draw_recovery,
            {"cases": LINES, **names(by_paper), "level": min(levels)},
            trajectories=every("<results>/trajectories/{case}.npz", case=LINES),
            reconstructions={
                case: f"<results>/reconstructions/{cell}.npz" for case, cell in least_noise.items()
            },
        ),
        "figure05": figure(
            "05 coefficients under noise",
            figures.each_term.draw_coefficients,
            {
                **papers,
                "kind": NOISE,
                "levels": noisy_cells,
                "unit": unit(by_paper[0]),
                "degree": DEGREE,
            },
            **draws,
            model=MODEL,
            identified=every(
                f"{coefficients_at}/{{cell}}/{by_paper[1].family}.npz", cell=noisy_cells
            ),
        ),
        "figure06": figure(
            "06 coefficient error against noise",
            figures.errors.draw_draws,
            papers | against_noise("coefficients"),
            **draws,
        ),
        "figure06_methods": figure(
            "06, all methods: coefficient error against noise",
            figures.errors.draw_methods,
            everything | against_noise("coefficients"),
            table=SCORES,
        ),
        "figure07": figure(
            "07 R2 against noise", figures.errors.draw_draws, papers | against_noise("r2"), **draws
        ),
        "figure07_methods": figure(
            "07, all methods: R2 against noise",
            figures.errors.draw_methods,
            everything | against_noise("r2"),
            table=SCORES,
        ),
        **histories("08", "time histories under noise", noisy_histories),
        **histories("09", "time histories by amount of data", sampled_histories),
        "figure10": figure(
            "10 R2 and amplitude by amount of data",
            figures.errors.draw_draws,
            papers | against_points("r2", "amplitude"),
            **draws,
        ),
        "figure10_methods": figure(
            "10, all methods: amplitude by amount of data",
            figures.errors.draw_methods,
            everything | against_points("amplitude"),
            table=SCORES,
        ),
        "claims": figure(
            "claims of the paper",
            figures.against_paper.draw_claims,
            {"combinations": [[p.name, m.name] for p, m in shown.claim_pairs(STUDY)]},
            table=table_of("claims"),
        ),
        "overview": figure(
            "overview: error against noise, and the bound",
            figures.errors.draw_overview,
            {"case": FIRST, "protocol": sensors.name, "label": noise_labels[sensors.name]},
            table=SCORES,
            peers=table_of("peers"),
        ),
        "efficiency": figure(
            "efficiency against noise",
            figures.errors.draw_efficiency,
            everything | {"labels": noise_labels},
            table=table_of("efficiency"),
        ),
        "identifiability": figure(
            "identifiability of each term",
            figures.each_term.draw_identifiability,
            everything | {"level": STUDY.settings.measurement.subsets.level},
            table=table_of("identifiability"),
        ),
        "limit_cycles": figure(
            "from which wind on, and how far",
            figures.motions.draw_limit_cycles,
            {
                "cases": {case.name: case.line for case in STUDY.cases},
                "parameter": "wind_speed",
                "label": "wind speed, m/s",
            },
            cycles=table_of("limit_cycles"),
            bifurcations=table_of("bifurcations"),
        ),
        "resonance_map": figure(
            "where the 2:1 resonance lies",
            figures.motions.draw_resonance_map,
            {
                "case": FIRST,
                "x_label": "wind speed, m/s",
                "y_label": "tension of a sub-conductor, kN",
                "y_scale": 1000,
            },
            table=table_of("resonance_map"),
        ),
        "orbits": figure(
            "orbits at mid-span",
            figures.engineering.draw_orbits,
            {"cases": {case.name: case.released for case in STUDY.cases}},
            orbits=every("<results>/assessment/{case}/orbits.npz", case=LINES),
        ),
        "prediction": figure(
            "other wind speeds, from an identified model",
            figures.motions.draw_prediction,
            {
                "case": FIRST,
                "protocols": list(predicted),
                **dict(zip(("method", "peer"), predicting[0], strict=False)),
                "replicate": 0,
                "recorded": first_case.line["wind"]["speed"],
            },
            table=table_of("prediction"),
        ),
        "limit_cycle_ahead": figure(
            "the limit cycle ahead of its time",
            figures.motions.draw_limit_cycle_ahead,
            {"window": WINDOW},
            table=table_of("limit_cycle_ahead"),
        ),
        "reduction": figure(
            "what two modes are worth", figures.verdicts.draw_reduction, table=table_of("reduction")
        ),
        "measures": figure(
            "what stops it",
            figures.engineering.draw_measures,
            {"cases": LINES},
            table=table_of("measures"),
        ),
    }
if REDRAWN:
    FIGURES["reproduction"] = figure(
        "what the missing parameters decide",
        figures.against_paper.draw_reproduction,
        {"labels": OPEN_LABELS},
        table=table_of("reproduction"),
    )
if has_trials(TRUST):
    FIGURES[TRUST] = figure(
        "how often each status is right", figures.verdicts.draw_trust, table=table_of("fits")
    )
if has_trials(MODEL_ERROR):
    FIGURES[MODEL_ERROR] = figure(
        "what a recording of a real line gives",
        figures.verdicts.draw_model_error,
        table=table_of(MODEL_ERROR),
    )
if has_trials(EXACT_TERMS):
    FIGURES[EXACT_TERMS] = figure(
        "exact terms beside published methods",
        figures.verdicts.draw_published_terms,
        table=table_of(EXACT_TERMS),
    )
if has_trials(INTERVALS):
    FIGURES[INTERVALS] = figure(
        "intervals after selection beside published ones",
        figures.verdicts.draw_published_intervals,
        table=table_of(INTERVALS),
    )
if has_trials(PAPER):
    FIGURES["paper_region"] = figure(
        "what the paper leaves out",
        figures.against_paper.draw_region,
        samples=SAMPLES,
        readings=READINGS,
    )
