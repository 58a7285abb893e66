"""Graph of the rules as an SVG: which rule reads the outputs of which other rule.

Usage: draw_rules.py FILE
"""

import sys
import tempfile
from collections.abc import Iterable

from galloping.configuration.kinds import KINDS
from galloping.reproducibility.plan import PlannedJob, make_plan
from galloping.storage import write_text

# study with jobs of every rule except `measure_motion`, whose files no other rule reads
FULL_STUDY = f"""
cases: {{gusty: {{truth: {{model: continuous}}}}}}
recordings: {{field: {{files: [examples/span.csv], mapping: examples/span.yaml}}}}
trials: {{{", ".join(f"{kind}: {{kind: {kind}}}" for kind in KINDS)}}}
"""
BOX_WIDTH, BOX_HEIGHT = 140, 24  # px
COLUMN_STEP, ROW_STEP = 176, 38  # px: distances between boxes
STYLE = (
    "text{font:12px sans-serif;text-anchor:middle}"
    "rect{fill:#fff;stroke:#444}path{fill:none;stroke:#999}"
)

Graph = dict[str, set[str]]  # by rule, those that it reads from


def build_graph(jobs: Iterable[PlannedJob]) -> Graph:
    """Map each rule to the rules whose outputs it reads, without links that others imply."""
    jobs = list(jobs)
    rule_of = {path: job.rule for job in jobs for path in job.outputs}
    reads: Graph = {job.rule: set() for job in jobs}
    for job in jobs:
        reads[job.rule] |= {rule_of[path] for path in job.inputs if path in rule_of} - {job.rule}
    return {
        rule: direct.difference(*(_all_before(reads, each) for each in direct))
        for rule, direct in reads.items()
    }


def _all_before(reads: Graph, rule: str) -> set[str]:
    return reads[rule].union(*(_all_before(reads, each) for each in reads[rule]))


def draw(reads: Graph) -> str:
    """Draw a graph of rules as SVG text, with boxes in columns and links from left to right.

    Each box is as far right as its readers allow.
    """

    def count_columns_after(rule: str) -> int:
        return max(
            (count_columns_after(each) + 1 for each in reads if rule in reads[each]), default=0
        )

    last = max(map(count_columns_after, reads))
    columns: dict[int, list[str]] = {}
    for rule in sorted(reads):
        columns.setdefault(last - count_columns_after(rule), []).append(rule)
    tallest = max(map(len, columns.values()))
    positions = {
        rule: (x * COLUMN_STEP + 4, round((row + (tallest - len(rules)) / 2) * ROW_STEP) + 4)
        for x, rules in columns.items()
        for row, rule in enumerate(rules)
    }
    lines = []
    for rule, (x, y) in positions.items():
        for x0, y0 in sorted(positions[each] for each in reads[rule]):
            start, end, half = x0 + BOX_WIDTH, x, (COLUMN_STEP - BOX_WIDTH) // 2
            y0, y1 = y0 + BOX_HEIGHT // 2, y + BOX_HEIGHT // 2
            curve = f"M{start} {y0}C{start + half} {y0} {end - half} {y1} {end} {y1}"
            lines.append(f'<path d="{curve}"/>')
    for rule, (x, y) in positions.items():
        lines.append(f'<rect x="{x}" y="{y}" width="{BOX_WIDTH}" height="{BOX_HEIGHT}" rx="4"/>')
        lines.append(f'<text x="{x + BOX_WIDTH // 2}" y="{y + 16}">{rule}</text>')
    width, height = len(columns) * COLUMN_STEP - (COLUMN_STEP - BOX_WIDTH) + 8, tallest * ROW_STEP
    head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}">'
    return "\n".join((head, f"<style>{STYLE}</style>", *lines, "</svg>\n"))


if __name__ == "__main__":
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
        file.write(FULL_STUDY)
        file.flush()
        jobs = make_plan([file.name]).jobs
    write_text(sys.argv[1], draw(build_graph(jobs)))
