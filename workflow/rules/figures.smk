# models, motions, tables -> figures
#
# A figure: its part of the report, its label there, and how it is made, as a table is (tables.smk).
# The title of a figure, what it shows of this study, comes from the function that draws it.
from galloping.deferred import figures  # the jobs import it
from galloping.results import NOISE, SUBSET

COEFFICIENT_LEVELS = (0.01, 0.05)
HISTORY_LEVELS = (0.05, 0.1, 0.15)
ANIMATION_LABEL = "the span in motion"


def table_of(name):
    return f"<results>/tables/{name}.csv"


def noise_label(protocol):
    """The axis of its noise levels."""
    return protocol.noise_label(STUDY.settings.measurement.state_noise == "relative")


def names(pair):
    protocol, method = pair
    return {"protocol": protocol.name, "method": method.name}


def against_noise(*quantities):
    """Scores of whole records."""
    labels = {p.name: noise_label(p) for p in STUDY.protocols}
    return {"kind": NOISE, "x": "level", "labels": labels, "quantities": list(quantities)}


def against_points(*quantities):
    """Scores of random samples."""
    labels = {p.name: "samples" for p in STUDY.protocols}
    return {"kind": SUBSET, "x": "points", "labels": labels, "quantities": list(quantities)}


def figure(part, label, function, settings=None, **reads):
    """How a figure is made. part, label: of and in the report."""
    return SimpleNamespace(part=part, label=label, **vars(made(function, settings, **reads)))


paper_figure = partial(figure, "paper")
methods_figure = partial(figure, "methods")
line_figure = partial(figure, "engineering")


def histories(label, labels):
    """Time histories of the first case by the paper's method. labels: of cells, by their name."""
    protocol, method = pair = shown.paper_pair(STUDY)
    cells = {f"{FIRST_CASE}/{protocol.name}/{cell}": text for cell, text in labels.items()}
    return paper_figure(
        label,
        figures.motions.draw_histories,
        {"case": FIRST_CASE, **names(pair), "cells": cells},
        trajectory=TRAJECTORY,
        reconstructions=every("<results>/reconstructions/{cell}.npz", cell=cells),
    )


FIGURES = {}
if DEPARTURES:
    FIGURES["printed"] = paper_figure(
        "the paper's printed numbers beside ours",
        figures.against_paper.draw_printed,
        {"case": next(iter(DEPARTURES))},
        table=table_of("paper"),
    )
if LINES:
    first_line = {"case": FIRST_CASE, "line": first_case.line}
    by_paper = shown.paper_pair(STUDY)
    papers = {"case": FIRST_CASE, **names(by_paper)}  # the paper's method on the first case
    draws = {"table": SCORES}  # its scores, and its many draws where the study has them
    if shown.is_paper_pair(by_paper) and FIRST_CASE in REDRAWN_CASES:
        draws["draws"] = f"<results>/paper/{FIRST_CASE}.csv"
    noisy_cells = {}  # empty without noise, and for a line without true coefficients
    if not first_case.is_continuous:
        chosen = shown.noise_cells(STUDY, by_paper, COEFFICIENT_LEVELS)
        noisy_cells = {each.name: each.level for each in chosen}
    coefficients_at = f"<results>/identified/{FIRST_CASE}/{by_paper[0].name}"
    levels, points = STUDY.settings.measurement.levels, STUDY.settings.measurement.subsets.points
    assessed, sensors = STUDY.settings.assessment, shown.sensor_protocol(STUDY)
    predicted = shown.predicted_cells(STUDY, FIRST_CASE)
    from_sensors = sensors.name if sensors.name in predicted else next(iter(predicted), "")
    predicting = shown.predicting_methods(predicted[from_sensors]) if predicted else [""]
    in_noise = shown.noise_cells(STUDY, by_paper, HISTORY_LEVELS)
    by_amount = reversed(shown.amount_cells(STUDY, by_paper))
    FIGURES |= {
        "figure01": paper_figure(
            "1 line and coordinates", figures.schematics.draw_line, first_line, model=MODEL
        ),
        "figure02": paper_figure(
            "2 aerodynamic load",
            figures.schematics.draw_aerodynamic_load,
            first_line,
            trajectory=TRAJECTORY,
        ),
        "figure03": paper_figure(
            "3 flow chart",
            figures.schematics.draw_flow,
            {
                "degree": DEGREE,
                "methods": [method.name for method in STUDY.methods],
                "levels": [min(levels), max(levels)],
                "points": [min(points), max(points)],
            },
        ),
        "figure04": paper_figure(
            "4 motion at the lowest noise" if min(levels) else "4 motion without noise",
            figures.motions.draw_recovery,
            {"cases": LINES, **names(by_paper), "level": min(levels)},
            trajectories=every("<results>/trajectories/{case}.npz", case=LINES),
            reconstructions={
                case: f"<results>/reconstructions/{cell}.npz" for case, cell in least_noise.items()
            },
        ),
        "figure05": paper_figure(
            "5 terms and coefficients under noise",
            figures.each_term.draw_coefficients,
            {
                **papers,
                "kind": NOISE,
                "levels": noisy_cells,
                "label": noise_label(by_paper[0]),
                "degree": DEGREE,
                "kinematics": STUDY.options(by_paper[1])["options"].get("kinematics"),
            },
            **draws,
            model=MODEL,
            identified=every(
                f"{coefficients_at}/{{cell}}/{by_paper[1].family}.json", cell=noisy_cells
            ),
        ),
        "figure06": paper_figure(
            "6 coefficient error against noise",
            figures.errors.draw_draws,
            papers | against_noise("coefficients"),
            **draws,
        ),
        "figure07": paper_figure(
            "7 R² against noise", figures.errors.draw_draws, papers | against_noise("r2"), **draws
        ),
        "figure08": histories(
            "8 time histories under noise",
            {each.name: f"noise {each.level:g}" for each in in_noise},
        ),
        "figure09": histories(
            "9 time histories by amount of data",
            {each.name: f"{each.samples:,} samples" for each in by_amount},
        ),
        "figure10": paper_figure(
            "10 R² and amplitude by amount of data",
            figures.errors.draw_draws,
            papers | against_points("r2", "amplitude"),
            **draws,
        ),
        "overview": methods_figure(
            "methods against sensor noise",
            figures.errors.draw_overview,
            {"case": FIRST_CASE, "protocol": sensors.name, "label": noise_label(sensors)},
            table=SCORES,
            peers=table_of("peers"),
        ),
        "prediction": methods_figure(
            "other wind speeds, from an identified model",
            figures.motions.draw_prediction,
            {
                "case": FIRST_CASE,
                "protocol": from_sensors,
                **dict(zip(("method", "peer"), predicting, strict=False)),
                "replicate": 0,
                "recorded": first_case.line["wind"]["speed"],
            },
            table=table_of("prediction"),
        ),
        "limit_cycles": line_figure(
            "from which wind, and how far",
            figures.motions.draw_limit_cycles,
            {
                "cases": {case.name: case.line for case in STUDY.cases},
                "parameter": "wind_speed",
                "label": "wind speed, m/s",
            },
            cycles=table_of("limit_cycles"),
            bifurcations=table_of("bifurcations"),
        ),
        "orbits": line_figure(
            "orbits at mid-span",
            figures.engineering.draw_orbits,
            {
                "cases": {case.name: case.released for case in STUDY.cases},
                "winds": sorted({*assessed.winds, assessed.design_wind}),
            },
            orbits=every("<results>/assessment/{case}/orbits.npz", case=LINES),
        ),
        "measures": line_figure(
            "measures against galloping",
            figures.engineering.draw_measures,
            {"cases": LINES},
            table=table_of("measures"),
        ),
        "resonance_map": line_figure(
            "wind, tension and the 2:1 resonance",
            figures.motions.draw_resonance_map,
            {
                "case": FIRST_CASE,
                "x_label": "wind speed, m/s",
                "y_label": "tension of a sub-conductor, kN",
                "y_scale": 1000,
            },
            table=table_of("resonance_map"),
        ),
    }
if has_trials(TRUST):
    FIGURES[TRUST] = methods_figure(
        "how often each status is right", figures.verdicts.draw_trust, table=table_of("fits")
    )
if has_trials(MODEL_ERROR):
    FIGURES[MODEL_ERROR] = methods_figure(
        "what a recording of a real line gives",
        figures.verdicts.draw_model_error,
        {"truths": [each for t in STUDY.trials if t.table == MODEL_ERROR for each in t.cases]},
        table=table_of(MODEL_ERROR),
    )
if has_trials(EXACT_TERMS):
    FIGURES[EXACT_TERMS] = methods_figure(
        "exact terms beside published methods",
        figures.verdicts.draw_published_terms,
        table=table_of(EXACT_TERMS),
    )
if has_trials(INTERVALS):
    FIGURES[INTERVALS] = methods_figure(
        "intervals after selection beside published ones",
        figures.verdicts.draw_published_intervals,
        table=table_of(INTERVALS),
    )
if has_trials(PAPER):
    FIGURES["paper_region"] = paper_figure(
        "what the paper leaves out",
        figures.against_paper.draw_region,
        region=table_of("paper_region"),
        readings=READINGS,
    )
