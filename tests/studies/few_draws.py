"""What few draws say of an evidence, beside many: docs/studies/few_draws.md.

Of each case the most probable hypotheses are weighed as the diagnosis does, with the first draws and with all that it
makes of what leads. Where less than 15 % of the first count, the same ln Z is found once more by 13 500 draws of
mixtures of t-distributions, which the diagnosis does not use. What does not count 40 of these draws itself is left out,
and counted.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass
from itertools import combinations, islice
from pathlib import Path

import numpy as np

from bayesmembrane.calibration.sampling.proposals.mixture import Mixture, fit_mixture
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.diagnosis.candidates.sampled import ByDraws, _TruePosterior, sampled
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.thresholds import SAMPLED
from bayesmembrane.ground.parameters import Array
from tests.studies.reliability import SOURCES, diagnosed, warmed

FEW = 0.15
"""Part of the draws; where more count, nothing is asked."""
HYPOTHESES = 8
"""Of each case, the most probable ones."""
ROUNDS, DRAWS, LEARN_FROM = 10, 1500, 600
LEAST = 40.0
"""Draws of the mixtures that must count, so that they say what is right."""
SEEDS = (31, 32, 33)


@dataclass(frozen=True)
class Compared:
    """One hypothesis: ln Z less the linear one by many draws, and what the first and all draws say, one a seed."""

    label: str
    many: float
    first: list[ByDraws]
    last: list[ByDraws]


def by_many(target: _TruePosterior, rng: np.random.Generator) -> tuple[float, float]:
    """(ln Z less the linear one, draws that count) by importance sampling from mixtures that adapt."""
    k = target.mean.size
    wide = np.linalg.cholesky(2 * target.covariance)
    parts = [Mixture(np.zeros(1), target.mean[None], wide[None], 6.0)]
    u, density = np.empty((0, k)), np.empty(0)
    for number in range(ROUNDS):
        new = parts[-1].draw(rng, DRAWS)
        u, density = np.concatenate([u, new]), np.concatenate([density, target.log_density(new)])
        weights = density - np.logaddexp.reduce([p.log_density(u) for p in parts], axis=0) + np.log(len(parts))
        if not np.any(np.isfinite(weights)):  # no film where the linear model sees one
            return -np.inf, 0.0
        if number < ROUNDS - 1:
            parts.append(fit_mixture(_flattened(u, weights, target.covariance, rng), rng))
    return float(np.logaddexp.reduce(weights) - np.log(weights.size)) - target.linear, _counting(weights)


def _flattened(u: Array, log_weights: Array, known: Array, rng: np.random.Generator) -> Array:
    """Draws by weights that are flattened until enough count, spread a little, so that none is there twice."""
    power = 1.0
    while _counting(power * log_weights) < 5 * u.shape[1] and power > 0.02:
        power *= 0.8
    p = np.exp(power * (log_weights - np.max(log_weights)))
    x = u[rng.choice(len(u), size=LEARN_FROM, p=p / np.sum(p))]
    root = np.linalg.cholesky(np.cov(x.T).reshape(known.shape) + 1e-9 * known)
    middle = np.mean(x, axis=0)
    return np.asarray(middle + np.sqrt(0.91) * (x - middle) + 0.3 * rng.standard_normal(x.shape) @ root.T)


def _counting(log_weights: Array) -> float:
    w = np.exp(log_weights - np.max(log_weights))
    return float(np.sum(w) ** 2 / np.sum(w * w))


def compared(source: str, half: str, seed: int, first: int, count: int) -> tuple[list[Compared], int]:
    """The hypotheses of some cases, and how many were left out."""
    out, left_out = list[Compared](), 0
    for case in islice(SOURCES[source].plan(half, seed), first, first + count):
        with tempfile.TemporaryDirectory() as folder:
            found = diagnosed(read_measurement(*SOURCES[source].measured(case).write(Path(folder))), None)
        search = Search(found.measurement, found.noise)
        for judged in found.ranking[:HYPOTHESES]:
            c = judged.candidate
            first, last = (
                [sampled(search, c, np.random.default_rng(s), drawing) for s in SEEDS]
                for drawing in (SAMPLED.first, SAMPLED.last)
            )
            if min(f.counting / f.drawn for f in first) >= FEW:
                continue
            many, counting = by_many(_TruePosterior(search, c), np.random.default_rng(11))
            if counting < LEAST:
                left_out += 1
                continue
            out.append(Compared(c.label, many, first, last))
            told = ", ".join(f"{told_of(f):.2f}" for f in (*first, *last))
            print(f"{case.number} {c.label}: {many:.2f} by many, {told}", flush=True)
    return out, left_out


def table(rows: list[Compared], left_out: int, command: str) -> str:
    """Markdown: errors of ln Z in three ways."""
    ways: dict[str, list[list[float]]] = {
        "linear": [[0.0] for _ in rows],
        "what the first draws found": [[found_of(f) for f in r.first] for r in rows],
        "that, and what they miss": [[told_of(f) for f in r.first] for r in rows],
        "what all draws found": [[found_of(f) for f in r.last] for r in rows],
        "that, and what they miss, too": [[told_of(f) for f in r.last] for r in rows],
    }
    lines = [f"`{command}`: {len(rows)} hypotheses; {left_out} left out, for many draws are no better there.", ""]
    lines += ["| ln Z | mean error | sd | mean absolute | largest | two runs apart |", "|" + " --- |" * 6]
    for name, each in ways.items():
        e = np.array([v - r.many for r, values in zip(rows, each, strict=True) for v in values])
        apart = [abs(a - b) for v in each for a, b in combinations(v, 2)]
        said = f"{np.mean(apart):.2f}" if apart else "-"
        numbers = f"{e.mean():.2f} | {e.std():.2f} | {np.abs(e).mean():.2f} | {np.abs(e).max():.1f} | {said}"
        lines.append(f"| {name} | {numbers} |")
    return "\n".join(lines) + "\n"


def found_of(draws: ByDraws) -> float:
    """ln Z less the linear one, as the draws alone have it."""
    return draws.found if draws.good else 0.0


def told_of(draws: ByDraws) -> float:
    """The same with what they miss."""
    return draws.difference if draws.good else 0.0


def main(arguments: list[str] | None = None) -> int:
    """Run, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--generator", choices=("own", "third"), default="own")
    parser.add_argument("--seed", type=int, default=400000)
    parser.add_argument("--first", type=int, default=700)
    parser.add_argument("--count", type=int, default=12)
    asked = parser.parse_args(arguments)
    half = "calibration" if asked.generator == "own" else SOURCES[asked.generator].half
    warmed()
    rows, left_out = compared(asked.generator, half, asked.seed, asked.first, asked.count)
    told = f"--generator {asked.generator} --seed {asked.seed} --first {asked.first} --count {asked.count}"
    print(table(rows, left_out, f"python -m tests.studies.few_draws {told}"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
