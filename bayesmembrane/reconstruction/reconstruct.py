"""The measured curve behind published losses.

A paper that prints the Euclidean distance between a measured force curve and K simulated ones, but not the curve, has
printed the curve all the same: K distances to K known points locate it, as a position follows from ranges. The unknown
number and first position of the training deflections, errors of the published simulations and misprints are part of
the question. `families` has what is believed of the curve beforehand, `model` the posterior, `fit` its modes and their
evidence, `counts` the numbers of points, `rows` the rows that contradict the others, and `mixture` what all families
say together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from bayesmembrane.data.published import PublishedTable, read_published_table
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.mechanics.api import force_curve
from bayesmembrane.reconstruction.counts import (
    Compared,
    Found,
    best_counts,
    compare_counts,
    search_again,
    search_counts,
    tell_counts,
)
from bayesmembrane.reconstruction.families.smooth_logarithm import SmoothLogarithm
from bayesmembrane.reconstruction.fit import Mode, again, find_mode
from bayesmembrane.reconstruction.mixture import (
    Placed,
    Told,
    families,
    least_probabilities,
    mixture,
    moved,
    place_all,
    probabilities,
    relative_evidence,
    tell,
    weigh,
)
from bayesmembrane.reconstruction.model import Knobs, LossModel
from bayesmembrane.reconstruction.result import FamilyResult, Influence, LossCheck, RangeResult, Reconstruction
from bayesmembrane.reconstruction.rows import RowCheck, check_row, set_aside, suspect
from bayesmembrane.reconstruction.scales import NUGGET, middle, solver_scales
from bayesmembrane.reconstruction.simulations import Simulate, tabulate

NEGLIGIBLE = 2e-3  # probability of a family below which it does not join the mixture


def simulate_on(table: PublishedTable) -> Simulate:
    """The package's solver on the table's rig, as a function of material, parameters and deflections."""

    def simulate(material: str, parameters: Sequence[float], deflection: Array) -> Array:
        force, _ = force_curve(material, parameters, deflection, table.inner_radius, table.outer_radius)
        return force

    return simulate


def reconstruct(table: PublishedTable | None = None, simulate: Simulate | None = None) -> Reconstruction:
    """Measured forces y, their positions, and misprints, from losses |y - F_k| and the forward model alone.

    Parameters
    ----------
    table : the published table; the source paper's unless given
    simulate : forces (N,) in N of (material, parameters, deflections in m), nan where there is none

    Raises `DataError` if the table holds too little or the forward model has no curve for its first row.
    """
    table = table if table is not None else read_published_table()
    simulate = simulate if simulate is not None else simulate_on(table)
    simulations = tabulate(table, simulate)
    family = SmoothLogarithm(simulations)
    model = LossModel(simulations, family, table.losses, simulations.usable, _all(table), (), table.step)
    model, searched, compared = _counted(model)
    mixed = curve_of_all_families(model, table, simulate)
    counted = _Counted(searched, _under_all(mixed, compared))
    return _answer(table, simulate, mixed, counted)


def curve_of_all_families(model: LossModel, table: PublishedTable, simulate: Simulate) -> Mixed:
    """What all families say together, at given numbers of points and with the rows that are believed."""
    start = find_mode(model, middle(model.curve, len(model.ranges)))
    state = model.evaluate(start.theta[None], start.knobs)
    near = np.array([state.x[0], state.force[0]])
    return _mixed(weigh(place_all(model, families(table, model.simulations, simulate, near), start)))


def _all(table: PublishedTable) -> tuple[int, ...]:
    return tuple(range(len(table.ranges)))


def _counted(model: LossModel) -> tuple[LossModel, list[Found], Compared]:
    """The model with the most probable numbers of points and without the rows that are wrong."""
    family, ranges = model.curve, model.ranges
    searched = [search_counts(model, r, family.middle, NUGGET) for r in ranges]
    knobs = middle(family, len(ranges))
    model = replace(model, counts=tuple(max(f, key=lambda n: f[n][0]) for f in searched))
    model = set_aside(model, find_mode(model, knobs))[0]
    searched = [search_again(model, r, family.middle, NUGGET, f) for r, f in enumerate(searched)]
    compared = compare_counts(model, knobs, searched, solver_scales(family, len(ranges)))
    return replace(model, counts=best_counts(compared)), searched, compared


class _Counted(NamedTuple):
    """What is known of the numbers of points: from each range alone, and from all together."""

    searched: list[Found]
    compared: Compared


class Mixed(NamedTuple):
    """All families, their probabilities (K,), and what those say that are likely, of forces at deflections x (N,)."""

    placed: list[Placed]
    probability: Array
    told: dict[int, Told]
    x: Array

    @property
    def share(self) -> Array:
        """Probabilities of the families that are mixed, in their order; they add up to 1."""
        share = self.probability[list(self.told)]
        return np.asarray(share / np.sum(share))

    @property
    def forces(self) -> tuple[Array, Array]:
        """Mean (N,) in N and covariance (N, N) in N^2 of the forces."""
        told = self.told.values()
        return mixture(np.array([t.force for t in told]), np.array([t.covariance for t in told]), self.share)

    @property
    def firsts(self) -> tuple[Array, Array]:
        """Mean (R,) in m and covariance (R, R) in m^2 of the first positions."""
        told = self.told.values()
        return mixture(np.array([t.first for t in told]), np.array([t.first_covariance for t in told]), self.share)

    @property
    def working(self) -> Placed:
        """The smooth logarithm: with it points are counted, rows judged and assumptions changed."""
        return self.placed[0]


def _mixed(placed: list[Placed]) -> Mixed:
    probability = probabilities([p.log_evidence for p in placed])
    first = placed[int(np.argmax(probability))]
    x = first.model.evaluate(first.best.theta[None], first.best.knobs).x[0]
    told = {k: tell(p, x) for k, p in enumerate(placed) if probability[k] > NEGLIGIBLE}
    return Mixed(placed, probability, told, x)


def _under_all(mixed: Mixed, compared: Compared) -> Compared:
    """The likely numbers of points with the evidence that all families together give them."""
    counts = list(compared)
    firsts = np.array([compared[c][1] for c in counts])
    gains = [relative_evidence(mixed.placed[k], counts, firsts) for k in mixed.told]
    mean = logsumexp(np.array(gains) + np.log(mixed.share)[:, None], axis=0)
    return {c: (float(e), compared[c][1]) for c, e in zip(counts, mean, strict=True)}


def _answer(table: PublishedTable, simulate: Simulate, mixed: Mixed, counted: _Counted) -> Reconstruction:
    force, covariance = mixed.forces
    model, mode = mixed.working.model, mixed.working.best
    checks = [check_row(model, mode, k) for k in range(len(table.rows))]
    wrong = np.flatnonzero(~model.use).tolist()
    base = _moved(model, mode, mixed.x)
    return Reconstruction(
        _ranges(table, mixed, force, np.sqrt(np.diag(covariance)), counted),
        covariance,
        _losses(table, mixed, checks),
        tuple(suspect(table, model, mode, checks[k], simulate) for k in wrong),
        tuple(replace(i, force=force + i.force - base) for i in _influence(model, mode, mixed.x)),
        _scales(table, mixed.working.modes),
        _families(mixed),
    )


def _families(mixed: Mixed) -> tuple[FamilyResult, ...]:
    best = max(p.log_evidence for p in mixed.placed)
    least = least_probabilities([p.log_evidence for p in mixed.placed]).tolist()
    found = []
    for k, (p, probability) in enumerate(zip(mixed.placed, mixed.probability.tolist(), strict=True)):
        told = mixed.told.get(k)
        force = None if told is None else told.force
        sd = None if told is None else np.sqrt(np.diag(told.covariance))
        numbers = probability, p.log_evidence - best, least[k]
        found.append(FamilyResult(p.family.name, p.family.title, *numbers, force, sd))
    return tuple(found)


def _ranges(table: PublishedTable, mixed: Mixed, force: Array, sd: Array, counted: _Counted) -> tuple[RangeResult, ...]:
    firsts, cov = mixed.firsts
    found = []
    for r, block in enumerate(mixed.working.model.blocks()):
        probability, positions = tell_counts(r, counted.searched[r], counted.compared)
        first = float(firsts[r]), float(np.sqrt(cov[r, r]))
        curve = mixed.x[block], force[block], sd[block]
        found.append(RangeResult(table.ranges[r], probability, positions, *first, *curve))
    return tuple(found)


def _losses(table: PublishedTable, mixed: Mixed, checks: list[RowCheck]) -> tuple[LossCheck, ...]:
    """Printed losses beside those of the families' most probable curves, averaged.

    Not of their average: curves at the right distance from a simulated one lie on a sphere, and their mean inside it.
    """
    distance = mixed.share @ np.array([_distances(mixed.placed[k]) for k in mixed.told])
    distance = distance.reshape(len(table.ranges), -1)
    found = []
    for k, (row, check) in enumerate(zip(table.rows, checks, strict=True)):
        for r, name in enumerate(table.ranges):
            predicted = float(row.loss[r] + check.excess[r])
            numbers = float(row.loss[r]), float(distance[r, k]), predicted, float(check.sd[r]), check.probability
            found.append(LossCheck(row.material, row.column, name, *numbers))
    return tuple(found)


def _distances(placed: Placed) -> Array:
    """(R K,) distances of the most probable curve of a family from the simulated ones, as they are simulated here."""
    model, mode = placed.model, placed.best
    state = model.evaluate(mode.theta[None], mode.knobs)
    gap = state.force[0][:, None] - model.simulations.forces(state.x)[0][0]
    return np.concatenate([np.linalg.norm(gap[block], axis=0) for block in model.blocks()])


# ---- what other assumptions would give -------------------------------------------------------------------------------


def _influence(model: LossModel, mode: Mode, x: Array) -> tuple[Influence, ...]:
    """The forces at deflections x (N,) when one assumption is changed."""
    k = mode.knobs
    roughness, nugget = np.asarray(k.roughness), np.asarray(k.nugget)
    changes: list[tuple[str, LossModel, Knobs, bool]] = [
        ("curve twice as smooth", model, k._replace(roughness=roughness / 2), True),
        ("curve twice as rough", model, k._replace(roughness=roughness * 2), True),
        ("curve four times as rough", model, k._replace(roughness=roughness * 4), True),
        ("load-cell noise a tenth", model, k._replace(nugget=nugget / 10), True),
        ("load-cell noise four times", model, k._replace(nugget=nugget * 4), True),
        ("errors with heavier tails (1 degree of freedom)", replace(model, tail=1.0), k, True),
        ("errors with lighter tails (6 degrees of freedom)", replace(model, tail=6.0), k, True),
        ("first positions uniform and independent", replace(model, recipe=False), k, False),
        ("all rows believed", replace(model, use=model.simulations.usable), k, False),
    ]
    found = []
    for changed, other, knobs, comparable in changes:
        moved = again(other, mode, knobs)
        gain = moved.evidence - mode.evidence if comparable else None
        found.append(Influence(changed, _moved(other, moved, x), gain))
    return (*found, _uncoupled(model, mode, x))


def _uncoupled(model: LossModel, mode: Mode, x: Array) -> Influence:
    """Each range with a smooth curve of its own."""
    parts = []
    for r, block in zip(model.ranges, model.blocks(), strict=True):
        alone = replace(model, ranges=(r,), counts=(model.counts[r],))
        knobs = mode.knobs._replace(solver=np.asarray(mode.knobs.solver)[:, [r]])
        parts.append(_moved(alone, find_mode(alone, knobs), x[block]))
    return Influence("each range with a smooth curve of its own", np.concatenate(parts), None)


def _moved(model: LossModel, mode: Mode, x: Array) -> Array:
    """(N,) forces of a mode at deflections x (N,), moved along its smooth curve."""
    theta = mode.theta[None]
    return np.asarray(moved(model, theta, mode.knobs, model.evaluate(theta, mode.knobs), x)[0])


def _scales(table: PublishedTable, modes: Sequence[Mode]) -> dict[str, float]:
    """Posterior means of the scales that the grid spans; dimensionless."""
    evidence = np.array([m.evidence for m in modes])
    weight = np.exp(evidence - logsumexp(evidence))
    solver = weight @ np.array([np.ravel(m.knobs.solver) for m in modes])
    return {
        "roughness": float(weight @ np.array([np.ravel(m.knobs.roughness)[0] for m in modes])),
        "rounding": float(weight @ np.array([np.ravel(m.knobs.rounding)[0] for m in modes])),
        **{f"solver_{name}": float(s) for name, s in zip(table.ranges, solver, strict=True)},
    }
