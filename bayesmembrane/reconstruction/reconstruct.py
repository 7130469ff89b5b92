"""The measured curve behind published losses.

A paper that prints the Euclidean distance between a measured force curve and K simulated ones, but not the curve, has
printed the curve all the same: K distances to K known points locate it, as a position follows from ranges. The unknown
number and first position of the training deflections, errors of the published simulations and misprints are part of
the question. `model` has the posterior, `fit` its mode, evidence and draws, `counts` the numbers of points, `rows` the
rows that contradict the others.
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
from bayesmembrane.reconstruction.fit import Draws, Mode, again, find_mode, knob_grid, knobs_at, sample, scan
from bayesmembrane.reconstruction.model import Knobs, LossModel, Simulate, tabulate
from bayesmembrane.reconstruction.result import Influence, LossCheck, RangeResult, Reconstruction
from bayesmembrane.reconstruction.rows import RowCheck, check_row, set_aside, suspect

# Scales of the errors, all equally probable beforehand; those in the middle are used where one setting must do.
ROUGHNESS = (0.07, 0.14, 0.28, 0.56)
NUGGET = 5e-3  # N: a load cell of a few kN resolves millinewtons
ROUNDING = (5e-5, 1.5e-4, 4.5e-4)
SOLVER = (3e-4, 7e-4, 1.6e-3)
CHAINS, DRAWS = 48, 60


def simulate_on(table: PublishedTable) -> Simulate:
    """The package's solver on the table's rig, as a function of material, parameters and deflections."""

    def simulate(material: str, parameters: Sequence[float], deflection: Array) -> Array:
        force, _ = force_curve(material, parameters, deflection, table.inner_radius, table.outer_radius)
        return force

    return simulate


def reconstruct(table: PublishedTable | None = None, simulate: Simulate | None = None, seed: int = 0) -> Reconstruction:
    """Measured forces y, their positions, and misprints, from losses |y - F_k| and the forward model alone.

    Parameters
    ----------
    table : the published table; the source paper's unless given
    simulate : forces (N,) in N of (material, parameters, deflections in m), nan where there is none
    seed : of the draws; the same seed gives the same answer

    Raises `DataError` if the table holds too little or the forward model has no curve for its first row.
    """
    table = table if table is not None else read_published_table()
    simulate = simulate if simulate is not None else simulate_on(table)
    simulations = tabulate(table, simulate)
    ranges = range(len(table.ranges))
    model = LossModel(simulations, table.losses, simulations.usable, tuple(ranges), (), table.step)
    searched = [search_counts(model, r, ROUGHNESS[1], NUGGET) for r in ranges]
    middle = knobs_at(ROUGHNESS[1], NUGGET, ROUNDING[1], (SOLVER[1],) * len(ranges))
    model = replace(model, counts=tuple(max(f, key=lambda n: f[n][0]) for f in searched))
    model = set_aside(model, find_mode(model, middle))[0]
    searched = [search_again(model, r, ROUGHNESS[1], NUGGET, f) for r, f in enumerate(searched)]
    grid = knob_grid(ROUGHNESS[1:2], (NUGGET,), ROUNDING[1:2], SOLVER, len(ranges))
    compared = compare_counts(model, middle, searched, grid)
    model = replace(model, counts=best_counts(compared))
    grid = knob_grid(ROUGHNESS, (NUGGET,), ROUNDING, SOLVER, len(ranges))
    modes = scan(model, grid, find_mode(model, middle))
    return _answer(table, simulate, model, modes, _Counted(searched, compared), seed)


class _Counted(NamedTuple):
    """What is known of the numbers of points: from each range alone, and from all together."""

    searched: list[Found]
    compared: Compared


def _answer(
    table: PublishedTable,
    simulate: Simulate,
    model: LossModel,
    modes: list[Mode],
    counted: _Counted,
    seed: int,
) -> Reconstruction:
    mode = max(modes, key=lambda m: m.evidence)
    draws = sample(model, modes, CHAINS, DRAWS, seed)
    forces, firsts = _at_mode(model, mode, draws)
    offset = forces - model.evaluate(mode.theta[None], mode.knobs).force[0]
    covariance = offset.T @ offset / offset.shape[0]
    checks = [check_row(model, mode, k) for k in range(len(table.rows))]
    wrong = np.flatnonzero(~model.use).tolist()
    return Reconstruction(
        _ranges(table, model, mode, np.sqrt(np.diag(covariance)), firsts, counted),
        covariance,
        _losses(table, model, mode, checks),
        tuple(suspect(table, model, mode, checks[k], simulate) for k in wrong),
        _influence(model, mode),
        _scales(table, modes),
        draws.acceptance,
    )


def _ranges(
    table: PublishedTable,
    model: LossModel,
    mode: Mode,
    sd: Array,
    firsts: Array,
    counted: _Counted,
) -> tuple[RangeResult, ...]:
    state = model.evaluate(mode.theta[None], mode.knobs)
    found = []
    for r, block in enumerate(model.blocks()):
        probability, positions = tell_counts(r, counted.searched[r], counted.compared)
        first = float(np.mean(firsts[:, r])), float(np.std(firsts[:, r]))
        curve = state.x[0, block], state.force[0, block], sd[block]
        found.append(RangeResult(table.ranges[r], probability, positions, *first, *curve))
    return tuple(found)


def _losses(table: PublishedTable, model: LossModel, mode: Mode, checks: list[RowCheck]) -> tuple[LossCheck, ...]:
    state = model.evaluate(mode.theta[None], mode.knobs)
    simulated, force = model.simulations.forces(state.x)[0][0], state.force[0]
    found = []
    for k, (row, check) in enumerate(zip(table.rows, checks, strict=True)):
        for r, (name, block) in enumerate(zip(table.ranges, model.blocks(), strict=True)):
            distance = float(np.linalg.norm(force[block] - simulated[block, k]))
            predicted = float(row.loss[r] + check.excess[r])
            numbers = float(row.loss[r]), distance, predicted, float(check.sd[r]), check.probability
            found.append(LossCheck(row.material, row.column, name, *numbers))
    return tuple(found)


def _at_mode(model: LossModel, mode: Mode, draws: Draws) -> tuple[Array, Array]:
    """Forces (M, N) of all draws at the positions of the mode, and their first positions (M, R) in m.

    A draw whose positions differ is moved along its own smooth curve: what is asked is the force at one deflection.
    """
    x = model.evaluate(mode.theta[None], mode.knobs).x
    forces, firsts = [], []
    for theta, state in zip(draws.theta, draws.states(model), strict=True):
        forces.append(state.force + model.smooth(theta, draws.knobs, np.repeat(x, len(theta), 0))[0] - state.smooth)
        firsts.append(state.first)
    return np.concatenate(forces), np.concatenate(firsts)


# ---- what other assumptions would give -------------------------------------------------------------------------------


def _influence(model: LossModel, mode: Mode) -> tuple[Influence, ...]:
    """The forces at the same deflections when one assumption is changed."""
    k = mode.knobs
    x = model.evaluate(mode.theta[None], k).x
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
        parts.append(_moved(alone, find_mode(alone, knobs), x[:, block]))
    return Influence("each range with a smooth curve of its own", np.concatenate(parts), None)


def _moved(model: LossModel, mode: Mode, x: Array) -> Array:
    """(N,) forces of a mode at deflections x (1, N), moved along its smooth curve."""
    state = model.evaluate(mode.theta[None], mode.knobs)
    force: Array = (state.force + model.smooth(mode.theta[None], mode.knobs, x)[0] - state.smooth)[0]
    return force


def _scales(table: PublishedTable, modes: list[Mode]) -> dict[str, float]:
    """Posterior means of the scales that the grid spans; dimensionless."""
    evidence = np.array([m.evidence for m in modes])
    weight = np.exp(evidence - logsumexp(evidence))
    solver = weight @ np.array([np.ravel(m.knobs.solver) for m in modes])
    return {
        "roughness": float(weight @ np.array([np.ravel(m.knobs.roughness)[0] for m in modes])),
        "rounding": float(weight @ np.array([np.ravel(m.knobs.rounding)[0] for m in modes])),
        **{f"solver_{name}": float(s) for name, s in zip(table.ranges, solver, strict=True)},
    }
