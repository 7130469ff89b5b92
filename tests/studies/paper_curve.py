"""What the paper's measured curve holds beside the material: every energy, both ranges, every candidate effect.

    python -m tests.studies.paper_curve [--seed 0] [--diagnose]

writes docs/studies/paper_curve.md. The curve is the one reconstructed from the printed losses, with its covariance.
Without ``--diagnose`` only whether energies and effects survive that covariance is made anew (a minute or two); the
diagnoses below it, which take far longer, are kept as they are.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.shipped import shipped
from bayesmembrane.diagnosis.diagnose import diagnose
from bayesmembrane.diagnosis.explanation.total import Judged
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.registry import components, ordinary_materials
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.words.diagnosis import sentence
from bayesmembrane.words.units import size_in_words
from tests.studies.paper_curve_bands import HEAD, bands
from tests.studies.paper_curve_bands import lines as bands_lines

TARGET = Path(__file__).resolve().parents[2] / "docs" / "studies" / "paper_curve.md"
CURVES = {"to 35.1 mm": "elastosil_50um_op1", "both ranges": "elastosil_50um_first_loading"}
SHOWN = 3
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
    """Diagnose, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--diagnose", action="store_true")
    asked = parser.parse_args()
    old = TARGET.read_text(encoding="utf-8")
    below = diagnoses(asked.seed) if asked.diagnose else old[old.index(DIAGNOSES) :]
    survive = ["# What the paper's curve holds beside the material", "", *WORDS, "", *HEAD, *bands_lines(*bands()), ""]
    TARGET.write_text("\n".join([*survive, below]), encoding="utf-8")


def diagnoses(seed: int) -> str:
    """The diagnosis of every energy on both ranges."""
    rows, sentences = [], []
    for words, stem in CURVES.items():
        measurement = read_measurement(shipped(f"{stem}.csv"), shipped(f"{stem}.toml"))
        for name in ordinary_materials():
            found = diagnose(measurement, hypothesis(name), seed=seed)
            rows += list(lines(words, name, found, measurement))
            sentences.append(f"- {name}, {words}: {sentence(found)}")
            print(sentences[-1], flush=True)
    return page(rows, sentences, seed)


def lines(words: str, name: str, found: Diagnosis, measurement: Measurement) -> list[str]:
    """The plain model, and the most probable single effects."""
    best = [j for j in found.ranking if len(j.candidate.names) == 1 and j.candidate.hypothesis.material.name == name]
    r = found.before
    out = [
        f"| {name} | {words} | none | | | | {1e3 * r.rmse_N:.3g} | {r.reduced_chi2:.3g} | | {found.verdict} |",
    ]
    return out + [line(words, name, j, found, measurement) for j in best[:SHOWN]]


def line(words: str, name: str, j: Judged, found: Diagnosis, measurement: Measurement) -> str:
    """One effect: its size, its weight, what it leaves and what it is worth in newtons."""
    effect = components("effects")[j.candidate.names[0]]()
    size = effect.size
    value = j.candidate.parameters[f"{effect.name}.{size.name}"]
    worth = float(np.max(np.abs(found.null.residual - j.candidate.residual)))
    rms = 1e3 * float(np.sqrt(np.mean(j.candidate.residual**2)))
    edge = " (a parameter at its bound)" if j.candidate.at_bound else ""
    return (
        f"| {name} | {words} | {effect.title} | {size_in_words(value, size.unit)}{edge} | "
        f"{j.gain:.1f} | {j.probability:.2f} | {rms:.3g} | {j.reduced_chi2:.3g} | {1e3 * worth:.3g} | |"
    )


def page(rows: list[str], sentences: list[str], seed: int) -> str:
    """The Markdown part about diagnoses."""
    head = [
        DIAGNOSES,
        "",
        f"Made by `python -m tests.studies.paper_curve --diagnose --seed {seed}`; the reconstructed curve with its "
        "covariance.",
        "",
        "| material | curve | effect | size | ln K | probability | rms, mN | reduced chi-square | worth at most, mN | "
        "verdict |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    return "\n".join([*head, *rows, "", "What is said of each:", "", *sentences, ""])


if __name__ == "__main__":
    main()
