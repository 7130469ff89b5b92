"""What the losses say of energies and effects when the curve between them is not sure: part of `paper_curve`.

Each energy, with and without an offset of the zeros, with an exact form and with one that is off by
a few percent, is fitted to the reconstructed curve and judged by Laplace's evidence: under the covariance of the smooth
logarithm alone, and under that of all families of curves.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from bayesmembrane.data.published import read_published_table
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import material
from bayesmembrane.reconstruction.families.displaced import SHIFT
from bayesmembrane.reconstruction.families.energy import TRUST, EnergyCurve, standard
from bayesmembrane.reconstruction.families.smooth_logarithm import SmoothLogarithm
from bayesmembrane.reconstruction.model import LossModel
from bayesmembrane.reconstruction.reconstruct import Mixed, curve_of_all_families, simulate_on
from bayesmembrane.reconstruction.simulations import tabulate

EXACT = 1e-6  # size of the form error of an exact form
FORMS = {"exact": EXACT, "off by 2 %": 0.02}
ZERO = 0.5e-3  # m: the prior that every analysis has for an offset of the zero
# Which of the three effects of the rig are free: offset of the deflection zero, frame, offset of the force zero.
EFFECTS = {
    "none": (False, False, False),
    "zero offset": (True, False, False),
    "force offset": (False, False, True),
}
ABSENT = -8.0  # standard normal number of a compliance of nothing
ROUNDS = 60
SETTLED = 1e-3  # gain of the log posterior that a further step promises: where the climb is over
BEYOND = 6.0  # standard deviations of the prior of an energy: a film from there on is not looked for
LONGEST = 1.0  # standard deviations of the prior that a step may go
TOLD = 0.1  # ... above which the table says that it was not
WRONG = 3  # the row that contradicts the others


@dataclass(frozen=True)
class Band:
    """A curve: deflections (N,) in m, forces (N,) in N, covariance (N, N) in N^2."""

    name: str
    x: Array
    force: Array
    covariance: Array

    def first(self, count: int) -> Band:
        """Its first points."""
        return replace(self, x=self.x[:count], force=self.force[:count], covariance=self.covariance[:count, :count])


@dataclass(frozen=True)
class Judged:
    """A film at its most probable parameters.

    log_evidence, chi2 : ln Z; chi-square per point
    shift, shift_sd : offset of the zero, m (nan if there is none)
    left : gain of the log posterior that a further step promised
    """

    log_evidence: float
    chi2: float
    shift: float
    shift_sd: float
    left: float


def bands() -> tuple[Band, Band]:
    """The curve of the smooth logarithm alone, and that of all families."""
    table = read_published_table()
    simulate = simulate_on(table)
    simulations = tabulate(table, simulate)
    curve = SmoothLogarithm(simulations)
    model = LossModel(simulations, curve, table.losses, simulations.usable, (0, 1), (10, 9), table.step)
    mixed: Mixed = curve_of_all_families(model.without(WRONG), table, simulate)
    alone = mixed.told[0]
    return Band("logarithm alone", mixed.x, alone.force, alone.covariance), Band("all families", mixed.x, *mixed.forces)


def judge(band: Band, family: EnergyCurve, effect: str, form: str) -> Judged:
    """Damped Gauss-Newton to the most probable film, expanded anew on the way, and Laplace's evidence there."""
    k, size = family.parameters, np.array([FORMS[form]])
    free = np.concatenate([np.ones(k, dtype=bool), EFFECTS[effect], np.full(family.size - k - 3, form != "exact")])
    sd = np.ones(family.size)
    sd[k] = ZERO / SHIFT
    c = np.where(np.arange(family.size) < k, np.resize(family.expansion.at, family.size), 0.0)
    c[k + 1] = 0.0 if free[k + 1] else ABSENT
    root = np.linalg.inv(np.linalg.cholesky(band.covariance))
    log_det = float(np.linalg.slogdet(band.covariance)[1])

    def level(c: Array) -> float:
        with np.errstate(all="ignore"):
            z = root @ (band.force - family.force(c[None], size, band.x[None])[0][0])
        return -0.5 * float(z @ z) - 0.5 * float(np.sum((c / sd)[free] ** 2))

    for _ in range(ROUNDS):
        family = family.about(c[:k])
        c[:k] = np.where(np.abs(c[:k] - family.expansion.at) < 1e-9, c[:k], family.expansion.at)
        force, _, rates = (v[0] for v in family.force(c[None], size, band.x[None]))
        a = (root @ rates)[:, free]
        precision = a.T @ a + np.diag(1 / sd[free] ** 2)
        gradient = a.T @ (root @ (band.force - force)) - c[free] / sd[free] ** 2
        step = np.linalg.solve(precision, gradient)
        left = 0.5 * float(step @ gradient)
        if left < SETTLED or np.max(np.abs(c[:k])) > BEYOND:
            break
        far = family.distance(family.expansion.at + step[:k]) / TRUST
        here, share = level(c), 1 / max(1.0, far, float(np.max(np.abs(step))) / LONGEST)
        least = 1e-3 * share
        while share > least:
            there = c.copy()
            there[free] += share * step
            if level(there) > here:
                break
            share /= 2
        else:
            break
        c = there
    count, unknown = band.x.size, int(np.sum(free))
    prior = -float(np.sum(np.log(sd[free]))) - 0.5 * float(np.linalg.slogdet(precision)[1])
    evidence = level(c) + prior - 0.5 * log_det - 0.5 * count * np.log(2 * np.pi)
    z = root @ (band.force - family.force(c[None], size, band.x[None])[0][0])
    place = int(np.sum(free[:k]))
    spread = SHIFT * float(np.sqrt(np.linalg.inv(precision)[place, place])) if free[k] else np.nan
    assert unknown == precision.shape[0]
    return Judged(evidence, float(z @ z) / count, SHIFT * c[k] if free[k] else np.nan, spread, left)


def lines(alone: Band, together: Band) -> Iterator[str]:
    """Rows of the table: every energy, effect and form on both curves, ln Z relative to the best of its column."""
    table = read_published_table()
    simulate = simulate_on(table)
    for words, count in (("to 35.1 mm", 10), ("both ranges", 19)):
        parts = [b.first(count) for b in (alone, together)]
        found: dict[tuple[str, str, str], list[Judged]] = {}
        for row in table.rows:
            if row.column != ("OP1" if count == 10 else "OP2"):
                continue
            if count == 19 and row.material in ("neo_hookean", "mooney_rivlin"):
                continue
            at = standard(material(row.material), np.array(row.values))
            for form in FORMS:
                for effect in EFFECTS:
                    top = float(np.max(parts[0].x))
                    family = EnergyCurve(material(row.material), simulate, top, at)
                    found[row.material, effect, form] = [judge(b, family, effect, form) for b in parts]
        best = np.max([[j.log_evidence for j in two] for two in found.values()], axis=0)
        for (name, effect, form), two in found.items():
            cells = []
            for j, top_evidence in zip(two, best, strict=True):
                shift = f"{1e3 * j.shift:+.2f} +- {1e3 * j.shift_sd:.2f}" if np.isfinite(j.shift) else ""
                settled = "" if j.left < TOLD else f" (not settled: {j.left:.2g} more)"
                cells += [f"{j.log_evidence - top_evidence:.1f}{settled}", f"{j.chi2:.2f}", shift]
            yield f"| {words} | {name} | {effect} | {form} | {' | '.join(cells)} |"


HEAD = (
    "| curve | energy | effect | form | ln Z, logarithm alone | chi2 / point | zero, mm | ln Z, all families | "
    "chi2 / point | zero, mm |",
    "|---|---|---|---|---|---|---|---|---|---|",
)

if __name__ == "__main__":
    print("\n".join([*HEAD, *lines(*bands())]), flush=True)
