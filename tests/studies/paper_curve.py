"""What the paper's measured curve holds beside the material: every energy, both ranges, every candidate effect.

    python -m tests.studies.paper_curve [--seed 0] [--diagnose]

writes docs/studies/paper_curve.md. The curve is the one reconstructed from the printed losses, with its covariance.
Without ``--diagnose`` whether energies and effects survive that covariance is made anew, with it the diagnoses; the
other part of the page is kept as it is.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.shipped import shipped
from bayesmembrane.diagnosis.diagnose import diagnose
from bayesmembrane.diagnosis.explanation.case import Question
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.registry import ordinary_materials
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.words.diagnosis import sentence
from tests.studies.paper_curve_bands import HEAD, bands
from tests.studies.paper_curve_bands import lines as bands_lines

TARGET = Path(__file__).resolve().parents[2] / "docs" / "studies" / "paper_curve.md"
CURVES = {"to 35.1 mm": "elastosil_50um_op1", "both ranges": "elastosil_50um_first_loading"}
SHOWN, LEAST = 3, 0.005
DIAGNOSES = "## Diagnoses"
WORDS = (
    "## Do ranking and effects survive the covariance?",
    "",
    "Made by `python -m tests.studies.paper_curve`. Each energy is fitted to the reconstructed curve, with an offset "
    "of the deflection zero (prior sd 0.5 mm), an offset of the force zero, or neither; with a "
    "form that is exact, or off by a smooth 2 %. ln Z is Laplace's evidence relative to the best of its column and "
    "range, under the covariance of the smooth logarithm alone and under that of all families of curves.",
)


def main() -> None:
    """Diagnose, or see what survives, and write that part of the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--diagnose", action="store_true")
    asked = parser.parse_args()
    old = TARGET.read_text(encoding="utf-8")
    end = old.index(DIAGNOSES)
    if asked.diagnose:
        text = old[:end] + diagnoses(asked.seed)
    else:
        survive = ["# What the paper's curve holds beside the material", "", *WORDS, "", *HEAD, *bands_lines(*bands())]
        text = "\n".join([*survive, "", old[end:]])
    TARGET.write_text(text, encoding="utf-8")


def diagnoses(seed: int) -> str:
    """The diagnosis of both ranges, with no energy declared and with each."""
    rows, sentences = [], []
    for words, stem in CURVES.items():
        measurement = read_measurement(shipped(f"{stem}.csv"), shipped(f"{stem}.toml"))
        for name in ("", *ordinary_materials()):
            asked = hypothesis(name or min(ordinary_materials()))
            found = diagnose(measurement, Question(asked, declared=bool(name)), seed=seed)
            rows.append(line(words, name or "none", found))
            sentences.append(f"- {name or 'none'}, {words}: {sentence(found)}")
            print(sentences[-1], flush=True)
    return page(rows, sentences, seed)


def line(words: str, declared: str, found: Diagnosis) -> str:
    """Verdict, the most probable sets and energies, the residual before and after."""
    p = found.probabilities
    sets, energies = (
        ", ".join(f"{n} {q:.2f}" for n, q in list(each.items())[:SHOWN] if q > LEAST)
        for each in (p.effects, p.energies)
    )
    return (
        f"| {words} | {declared} | {found.verdict} | {sets} | {energies} | {1e3 * found.before.rmse_N:.3g} | "
        f"{1e3 * found.after.rmse_N:.3g} |"
    )


def page(rows: list[str], sentences: list[str], seed: int) -> str:
    """The Markdown part about diagnoses."""
    head = [
        DIAGNOSES,
        "",
        f"Made by `python -m tests.studies.paper_curve --diagnose --seed {seed}`; the reconstructed curve under the "
        "covariance of all families, with no energy declared and with each. Probabilities of sets are summed over "
        "energies, and those of energies over sets.",
        "",
        "| curve | declared | verdict | most probable sets | energies | rms before, mN | after, mN |",
        "|---|---|---|---|---|---|---|",
    ]
    return "\n".join([*head, *rows, "", "What is said of each:", "", *sentences, ""])


if __name__ == "__main__":
    main()
