"""The paper's five materials compared on its first range, its second, and both together; on the first under each noise.

    python -m tests.studies.comparison [--seed 0] [--chains chains]

writes docs/studies/comparison.md. The curve is the one reconstructed from the printed losses, with its covariance.
Ctrl-C keeps what is finished; the same command goes on from there.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from bayesmembrane.app.demo import shipped_ranges
from bayesmembrane.comparison.compare import claimed, compare_ranges
from bayesmembrane.comparison.jobs import Judging
from bayesmembrane.comparison.result import Comparison
from bayesmembrane.data.published import read_published_table
from bayesmembrane.ground.registry import ordinary_materials
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.report.blocks import Table
from bayesmembrane.report.sections.evidence import sentences
from bayesmembrane.report.sections.evidence.tables import (
    evidence_table,
    modes_table,
    noises_table,
    ranking_table,
    widths_table,
)
from bayesmembrane.words.beside_paper import paper_losses
from bayesmembrane.words.comparison import no_ranking
from bayesmembrane.words.noises import of_noise

TARGET = Path(__file__).resolve().parents[2] / "docs" / "studies" / "comparison.md"


def main() -> None:
    """Compare, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--chains", type=Path, default=Path("chains"))
    asked = parser.parse_args()
    judging, ranges = Judging(asked.seed, out=asked.chains), shipped_ranges()
    claims = [hypothesis(name) for name in ordinary_materials()]
    found = compare_ranges(ranges, claims, judging, progress=tell)
    doubted = claimed(",".join(ordinary_materials()), "", "auto", "reached")
    noises = compare_ranges({"OP1": ranges["OP1"]}, doubted, replace(judging, modes=False), progress=tell)
    TARGET.write_text(page(found, losses(), asked.seed) + whatever_the_noise(noises), encoding="utf-8")


def losses() -> dict[str, dict[str, float]]:
    """The paper's losses, N: of its optima over their ranges, and of the best of its sets over all points of both."""
    both: dict[str, float] = {}
    for row in read_published_table().rows:
        both[row.material] = min(both.get(row.material, np.inf), float(np.linalg.norm(row.loss)))
    return {**paper_losses(read_published_table()), "OP1 and OP2": both}


def tell(label: str, text: str) -> None:
    """A line for each step."""
    if "sampling:" not in text:
        print(f"{label}: {text}", flush=True)


def page(found: Mapping[str, Comparison], paper: Mapping[str, Mapping[str, float]], seed: int) -> str:
    """The Markdown page."""
    tables = [evidence_table(found), ranking_table(found, paper), modes_table(found), widths_table(found)]
    parts = [
        "# Five materials on the paper's curve",
        f"Made by `python -m tests.studies.comparison --seed {seed}`; the reconstructed curve with its covariance. OP1 "
        "is the paper's first range, to 35.1 mm, OP2 its second, to 91.5 mm. The paper fitted each of them, not both "
        "together; its loss over both is the least root of the sum of squares that one of its parameter sets has.",
        "\n".join(f"- {sentence}" for sentence in sentences(found, paper)),
        *(f"{t.caption}\n\n{markdown(t)}" for t in tables if t is not None),
    ]
    return "\n\n".join(parts) + "\n"


def whatever_the_noise(found: Mapping[str, Comparison]) -> str:
    """The part of the page on noise models."""
    tables = [t for t in (noises_table(found), evidence_table(found)) if t is not None]
    words = [f"- {name}: {of_noise(c)} {no_ranking(c)}".rstrip() for name, c in found.items()]
    parts = ["\n## Whatever the noise", "\n".join(words), *(f"{t.caption}\n\n{markdown(t)}" for t in tables)]
    return "\n\n".join(parts) + "\n"


def markdown(table: Table) -> str:
    """A table with its heads."""
    rows = [[c.head for c in table.columns], ["---"] * len(table.columns), *table.cells()]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


if __name__ == "__main__":
    main()
