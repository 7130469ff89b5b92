"""How often the stated band of a reconstruction holds the true forces: synthetic curves of every family.

    python -m tests.studies.reconstruction_coverage [--seed 0] [--replicates 1] [--budget s]

writes docs/studies/reconstruction_coverage.md. True curves resemble the measured one, each force to a tenth: they are
drawn from each family given that, or are films of one energy, solved by shooting, with the zero 2 mm off. Their losses
are those a paper would print: load-cell noise, printed rows solved by shooting, with errors of the size that the
paper's have. The numbers of points are taken as known.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bayesmembrane.data.published import PublishedTable, read_published_table
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import material
from bayesmembrane.physics.mechanics.api import request, solve
from bayesmembrane.reconstruction.families.base import CurveFamily
from bayesmembrane.reconstruction.families.smooth_logarithm import SmoothLogarithm
from bayesmembrane.reconstruction.mixture import families
from bayesmembrane.reconstruction.model import LossModel
from bayesmembrane.reconstruction.reconstruct import curve_of_all_families, simulate_on
from bayesmembrane.reconstruction.simulations import tabulate

TARGET = Path(__file__).resolve().parents[2] / "docs" / "studies" / "reconstruction_coverage.md"
COUNTS, FIRSTS = (10, 9), (1.05e-3, 0.7e-3)
LIKE = 0.10  # of each force, and of a fiftieth of the largest: how far true curves are from the measured one
NOISE, COMMON, OWN = 5e-3, 2e-4, 3e-4  # N; of the forces; of the forces
WIDE = 1.6449  # standard deviations either side of a 90 % band
SHIFT = 2e-3  # m

Curve = Callable[[Array], Array]


@dataclass(frozen=True)
class Truth:
    """A true curve: forces (N,) in N at deflections (N,) in m."""

    name: str
    curve: Curve


def shot(table: PublishedTable, name: str, values: tuple[float, ...], x: Array) -> Array:
    """Forces (N,) of a film by shooting; no force below zero deflection."""
    order, taut = np.argsort(x), np.maximum(np.sort(x), 1e-5)
    asked = request(material(name), np.array(values), taut, table.inner_radius, table.outer_radius, solver="shooting")
    force = np.empty(x.size)
    force[order] = solve(asked).force[0]
    return np.where(x > 1e-5, force, 0.0)


def of_family(family: CurveFamily, x: Array, force: Array, rng: np.random.Generator) -> Curve:
    """A curve of a family, given that it resembles ``force``."""
    family, c = family.placed(x, force)
    size = np.array([family.middle])
    sd = LIKE * (np.abs(force) + 0.02 * float(np.max(force)))
    a = family.force(c[None], size, x[None])[2][0] / sd[:, None]
    root = np.linalg.inv(np.linalg.cholesky(a.T @ a + np.eye(family.size))).T
    drawn = c + root @ rng.standard_normal(c.size)
    return lambda at: family.force(drawn[None], size, at[None])[0][0]


def truths(table: PublishedTable, replicates: int, rng: np.random.Generator) -> Iterator[Truth]:
    """Curves of every family that can be like the measured one, and of energies with the zero off."""
    simulate = simulate_on(table)
    simulations = tabulate(table, simulate)
    yeoh = next(row for row in table.rows if row.label == "yeoh OP2")
    x = np.linspace(1e-3, max(table.ends), 30)
    force = simulate(yeoh.material, yeoh.values, x)
    for _ in range(replicates):
        for family in families(table, simulations, simulate, np.array([x, force])):
            if family.name not in ("neo_hookean", "mooney_rivlin"):
                yield Truth(family.name, of_family(family, x, force, rng))
    for row in table.rows:
        if row.column == "OP2" and row.material in ("gent", "yeoh", "ogden"):
            for shift in (-SHIFT, 0.0, SHIFT):
                yield Truth(
                    f"{row.material}, zero {1e3 * shift:+.0f} mm",
                    lambda at, r=row, s=shift: shot(table, r.material, r.values, at - s),  # type: ignore[misc]
                )


def printed(
    table: PublishedTable, truth: Truth, simulated: list[Array], rng: np.random.Generator
) -> tuple[PublishedTable, list[Array]]:
    """The table with the losses of a true curve, and the measured forces."""
    positions = where(table)
    measured = [truth.curve(x) + NOISE * rng.standard_normal(x.size) for x in positions]
    common = [1 + COMMON * rng.standard_normal(x.size) for x in positions]
    rows = []
    for k, row in enumerate(table.rows):
        losses = []
        for r, y in enumerate(measured):
            own = 1.0 if row.material == "neo_hookean" else 1 + OWN * rng.standard_normal(y.size)
            losses.append(f"{np.linalg.norm(y - simulated[r][k] * common[r] * own):.8g}")
        rows.append(replace(row, losses=tuple(losses)))
    return replace(table, rows=tuple(rows)), measured


def where(table: PublishedTable) -> list[Array]:
    """The true deflections of each range, m."""
    return [np.linspace(a, e, n) for a, e, n in zip(FIRSTS, table.ends, COUNTS, strict=True)]


def judge(table: PublishedTable, truth: Truth, measured: list[Array]) -> tuple[Array, Array, dict[str, float]]:
    """Errors of the forces (N,) and their stated standard deviations, N, and the probabilities of the families."""
    simulate = simulate_on(table)
    simulations = tabulate(table, simulate)
    ranges = tuple(range(len(table.ranges)))
    curve = SmoothLogarithm(simulations)
    model = LossModel(simulations, curve, table.losses, simulations.usable, ranges, COUNTS, table.step)
    mixed = curve_of_all_families(model, table, simulate)
    force, covariance = mixed.forces
    x = np.concatenate(where(table))
    true = np.concatenate(measured) + truth.curve(mixed.x) - truth.curve(x)
    named = {p.family.name: float(q) for p, q in zip(mixed.placed, mixed.probability, strict=True)}
    return force - true, np.sqrt(np.diag(covariance)), named


def main() -> None:
    """Reconstruct every true curve and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--budget", type=float, default=np.inf, help="s after which no further curve is begun")
    parser.add_argument("--replicates", type=int, default=1)
    asked = parser.parse_args()
    rng, table = np.random.default_rng(asked.seed), read_published_table()
    mended = replace(table.rows[3], parameters=("7.5", *table.rows[3].parameters[1:]))
    table = table.with_row(3, mended)
    simulated = [np.array([shot(table, r.material, r.values, x) for r in table.rows]) for x in where(table)]
    rows, inside, scores, stopped = [], [], [], False
    began = time.monotonic()
    for truth in truths(table, asked.replicates, rng):
        if time.monotonic() - began > asked.budget:
            stopped = True
            break
        losses, measured = printed(table, truth, simulated, rng)
        error, sd, named = judge(losses, truth, measured)
        z = error / sd
        inside.append(np.abs(z) < WIDE)
        scores.append(z)
        best = max(named, key=lambda n: named[n])
        rows.append(
            f"| {truth.name} | {np.mean(inside[-1]):.2f} | {np.max(np.abs(z)):.1f} | {1e3 * error[1]:.0f} | "
            f"{1e3 * sd[1]:.0f} | {best} ({named[best]:.2f}) |"
        )
        print(rows[-1], flush=True)
    TARGET.write_text(page(rows, np.array(inside), np.array(scores), asked, stopped), encoding="utf-8")


def page(rows: list[str], inside: Array, z: Array, asked: argparse.Namespace, stopped: bool) -> str:
    """The Markdown page."""
    curves = np.mean(inside, axis=1)
    head = [
        "# Does the band around a reconstructed curve hold?",
        "",
        "Made by `python -m tests.studies.reconstruction_coverage "
        f"--seed {asked.seed} --replicates {asked.replicates}`"
        + (f", stopped after {len(rows)} curves." if stopped else "."),
        "",
        f"{len(rows)} synthetic curves, {inside.size} forces. **The stated 90 % band holds {np.mean(inside):.3f} of "
        f"the true forces** (+- {np.std(curves) / np.sqrt(len(rows)):.3f}, from the scatter between curves); root mean "
        f"square of error over standard deviation {np.sqrt(np.mean(z**2)):.2f}.",
        "",
        f"By force, OP1: {', '.join(f'{v:.2f}' for v in np.mean(inside, axis=0)[: COUNTS[0]])}; "
        f"OP2: {', '.join(f'{v:.2f}' for v in np.mean(inside, axis=0)[COUNTS[0] :])}.",
        "",
        "| true curve | in the band | largest error, sd | error at 4.8 mm, mN | its sd, mN | most probable family |",
        "|---|---|---|---|---|---|",
    ]
    return "\n".join([*head, *rows, ""])


if __name__ == "__main__":
    main()
