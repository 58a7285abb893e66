# what readers see: the tables and figures of the study, and where they look
COMPARED = [  # with the reference
    "table1_conductor",
    "table2_spacers",
    "table3_coefficients",
    "noise_coefficients",
    "noise_r2",
    "data_amount",
    "claims",
    "efficiency",
    "identifiability",
    "further_recordings",
]
TABLES = [*COMPARED, "scores", "reference_summary", "reference_differences"]
# where tables and figures that show one protocol and method look: the first pair that can run
PAPER_CELL = next(
    {"protocol": protocol, "method": method}
    for method in METHODS
    for protocol in PROTOCOLS
    if runs(method, protocol, min(LEVELS, key=LEVELS.get))
)


def tables():
    return [out(f"tables/{name}.csv") for name in TABLES]


def table(name):
    """A table of the study, with its caption in the report."""
    return report(
        out(f"tables/{name}.csv"),
        caption=f"../report/{name}.rst",
        category="Tables",
        labels={"table": name},
    )


FIGURES = {
    "figure01": "01 line and coordinates",
    "figure02": "02 aerodynamic load",
    "figure03": "03 flow chart",
    "figure04": "04 motion without noise",
    "figure05": "05 coefficients under noise",
    "figure06": "06 coefficient error against noise",
    "figure07": "07 R2 against noise",
    "figure08": "08 time histories under noise",
    "figure09": "09 time histories by amount of data",
    "figure10": "10 R2 and amplitude by amount of data",
    "claims": "claims of the paper",
    "overview": "overview: error against noise, and the bound",
    "efficiency": "efficiency against noise",
    "identifiability": "identifiability of each term",
}
FIRST_CASE = CASES[0]  # shown where one case has to do
SHOWN_METHODS = [*METHODS, BOUND]  # in figures of all methods
OURS = "maximum_likelihood"
CLAIM_METHODS = [m for m in METHODS if m in METHODS[:2] or m == OURS]
# the paper had velocities, which its method needs
CLAIM_PROTOCOLS = [p for p in PROTOCOLS if runs(PAPER_CELL["method"], p, min(LEVELS))]
SENSOR_PROTOCOL = "state" if "state" in PROTOCOLS else PROTOCOLS[0]
OUR_CELL = {"protocol": SENSOR_PROTOCOL, "method": OURS}
# time histories: what the paper did, and beside it what can be had from sensors
SHOWN_CELLS = [PAPER_CELL, *([OUR_CELL] if OURS in METHODS and OUR_CELL != PAPER_CELL else ())]


def figures():
    return [out(f"figures/{name}.{form}") for name in FIGURES for form in ("svg", "png")]


def vector(name):
    """The SVG of a figure, with its caption in the report."""
    return report(
        out(f"figures/{name}.svg"),
        caption=f"../report/{f'figure_{name}' if name in TABLES else name}.rst",
        category="Figures",
        labels={"figure": FIGURES[name]},
    )


def raster(name):
    return out(f"figures/{name}.png")


def shown_levels(wanted):
    """Those of the wanted noise levels that the study has, else its three lowest above zero."""
    positive = sorted(level for level in LEVELS.values() if level > 0)
    return [level for level in positive if level in wanted] or positive[:3]


def of_paper(chosen, cells):
    """The chosen levels or sizes that the paper's protocol and method have, by cell.

    cells: from the cell's name to its level or size.
    """
    return {
        cell: cells[cell]
        for cell in sorted(cells, key=cells.get)
        if cells[cell] in chosen and runs(PAPER_CELL["method"], PAPER_CELL["protocol"], cell)
    }


MOTION = "reconstructions/{case}/{protocol}/{cell}.npz"
IDENTIFIED = "identified/{case}/{protocol}/{cell}/{method}.npz"


COEFFICIENT_CELLS = of_paper(shown_levels((0.01, 0.03, 0.05)), LEVELS)
NOISE_CELLS = of_paper(shown_levels((0.05, 0.1, 0.15)), LEVELS)
AMOUNT_CELLS = of_paper(SUBSETS.values(), SUBSETS)
