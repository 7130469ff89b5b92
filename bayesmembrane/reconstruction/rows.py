"""Which printed rows contradict the others, and the smallest corrections that restore consistency."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from bayesmembrane.data.published import PrintedSet, PublishedTable
from bayesmembrane.ground.parameters import Array
from bayesmembrane.reconstruction.fit import Mode, again, find_mode
from bayesmembrane.reconstruction.model import LossModel
from bayesmembrane.reconstruction.simulations import Simulate

WRONG = 0.05  # prior probability that a row is wrong
DECADES = 4.0  # a wrong loss is off by any order of magnitude, from the solver's error up: this many decades
SURE = 0.95  # probability from which on a row is set aside
AGREES = 3.0  # standard deviations within which a loss agrees with a prediction
FACTORS = np.linspace(-2.0, 3.0, 101)  # tried on a parameter
FINE, DIPS = 5001, 4  # interpolated values, and how many of their dips are followed up


@dataclass(frozen=True)
class RowCheck:
    """A row's losses as the other rows predict them.

    Attributes
    ----------
    index : place of the row in the table
    excess : (R,) predicted minus printed loss, N; nan for a row without simulated curve
    sd : (R,) standard deviation of that difference, N: curve, positions, and errors of this material's simulations
    probability : that the row is wrong
    """

    index: int
    excess: Array
    sd: Array
    probability: float


@dataclass(frozen=True)
class Correction:
    """One printed entry and what it should be to agree with the rest.

    Attributes
    ----------
    entry : a parameter's name, or ``loss_<range>``
    printed : as printed
    consistent : the shortest number within two standard deviations of the best one
    best, sd : the best value and its standard deviation
    """

    entry: str
    printed: str
    consistent: float
    best: float
    sd: float


@dataclass(frozen=True)
class PredictedLoss:
    """One printed loss of a row and what the other rows say it is; nan for a row without simulated curve.

    range : its name
    printed : as printed, N
    predicted, sd : N
    """

    range: str
    printed: str
    predicted: float
    sd: float


@dataclass(frozen=True)
class Suspect:
    """A row that contradicts the others.

    Attributes
    ----------
    material, column : which row
    losses : what the others predict, range by range
    probability : that the row is wrong
    corrections : the smallest set of changes that mends it
    alternatives : other sets of the same or a larger size
    """

    material: str
    column: str
    losses: tuple[PredictedLoss, ...]
    probability: float
    corrections: tuple[Correction, ...]
    alternatives: tuple[tuple[Correction, ...], ...]

    @property
    def simulated(self) -> bool:
        """Whether the forward model has a curve for the printed parameters."""
        return bool(np.all(np.isfinite([p.predicted for p in self.losses])))


def check_row(model: LossModel, mode: Mode, index: int) -> RowCheck:
    """Predict a row from the others: the mode without it, its losses there, and how far they may be off.

    The errors of a material's simulations over a range are a Student t vector; given the other rows' errors, that of
    this row is again a Student t, with more degrees of freedom and a scale that these rows have taught.
    """
    model = model.without(index)
    mode = again(model, mode)
    state = model.evaluate(mode.theta[None], mode.knobs)
    rows = model.simulations.family.size
    places = [r * rows + index for r in range(len(model.ranges))]
    scale = model.error_scale(mode.knobs, 1)
    _, size, total = model.weights(state.residual / scale)
    jacobian = state.jacobian[0, places]
    spread = np.einsum("ip,pq,iq->i", jacobian, mode.covariance(), jacobian)
    excess = state.residual[0, places]
    own, sd, freedom = scale[0, places], np.empty(len(places)), np.empty(len(places))
    for i in range(len(places)):
        group = _group(model, index, i)
        freedom[i] = model.tail + size[group]
        sd[i] = np.sqrt(own[i] ** 2 * (model.tail + total[0, group]) / freedom[i] + spread[i])
    if not model.simulations.usable[index]:
        return RowCheck(index, np.full(len(places), np.nan), sd, 1.0)
    return RowCheck(index, excess, sd, _probability_wrong(excess, sd, freedom, own))


def _group(model: LossModel, index: int, place: int) -> int:
    """Which Student t vector a row's loss over a range belongs to."""
    materials = int(model.simulations.material.max()) + 1
    return place * materials + int(model.simulations.material[index])


def _probability_wrong(excess: Array, sd: Array, freedom: Array, scale: Array) -> float:
    """P(wrong) of a row: half the wrong ones have a wrong parameter (all losses off), half a single wrong loss.

    A wrong loss is off by d with density 1 / (2 d ln 10^DECADES), |d| from the solver's error up.
    """
    from scipy import stats  # on demand: it takes a second

    right = stats.t.logpdf(excess / sd, freedom) - np.log(sd)
    wrong = -np.log(2 * np.maximum(np.abs(excess), scale) * DECADES * np.log(10.0))
    single = np.logaddexp.reduce(np.sum(right) - right + wrong) - np.log(right.size)
    log_odds = np.logaddexp(np.sum(wrong), single) - np.log(2) + np.log(WRONG / (1 - WRONG)) - np.sum(right)
    return float(1 / (1 + np.exp(-np.clip(log_odds, -700, 700))))


def set_aside(model: LossModel, mode: Mode) -> tuple[LossModel, Mode]:
    """Take out the row that is most surely wrong, again and again, until none is."""
    while np.count_nonzero(model.use) > 4:
        checks = [check_row(model, mode, int(k)) for k in np.flatnonzero(model.use)]
        worst = max(checks, key=lambda c: c.probability)
        if worst.probability < SURE:
            break
        model = model.without(worst.index)
        mode = find_mode(model, mode.knobs)
    return model, mode


# ---- corrections -----------------------------------------------------------------------------------------------------


def suspect(table: PublishedTable, model: LossModel, mode: Mode, check: RowCheck, simulate: Simulate) -> Suspect:
    """What the row would have to say, by its smallest corrections: one parameter or loss, then several losses."""
    row = table.rows[check.index]
    sets: list[tuple[Correction, ...]] = [(c,) for c in _parameter_corrections(row, model, mode, check, simulate)]
    losses = _loss_corrections(table, row, check)
    sets = sorted([*sets, losses] if losses else sets, key=lambda s: (len(s), _edits(s)))
    return Suspect(
        row.material,
        row.column,
        _predicted(table, row, check),
        check.probability,
        sets[0] if sets else (),
        tuple(sets[1:]),
    )


def _predicted(table: PublishedTable, row: PrintedSet, check: RowCheck) -> tuple[PredictedLoss, ...]:
    parts = zip(table.ranges, row.losses, row.loss, check.excess, check.sd, strict=True)
    return tuple(PredictedLoss(name, printed, float(loss + e), float(s)) for name, printed, loss, e, s in parts)


def _loss_corrections(table: PublishedTable, row: PrintedSet, check: RowCheck) -> tuple[Correction, ...]:
    """The losses that disagree, replaced by what the other rows predict."""
    found = []
    for name, printed, loss, excess, sd in zip(table.ranges, row.losses, row.loss, check.excess, check.sd, strict=True):
        if abs(excess) > AGREES * sd:
            best = float(loss + excess)
            found.append(Correction(f"loss_{name}", printed, _shortest(best, float(sd)), best, float(sd)))
    return tuple(found)


def _parameter_corrections(
    row: PrintedSet, model: LossModel, mode: Mode, check: RowCheck, simulate: Simulate
) -> list[Correction]:
    """Single parameters whose change makes all losses agree."""
    state = model.evaluate(mode.theta[None], mode.knobs)
    order = np.argsort(state.x[0])

    def miss(values: Sequence[float]) -> Array:
        """(R,) simulated minus printed loss in standard deviations; inf where there is no force."""
        force = np.full(order.size, np.nan)
        force[order] = simulate(row.material, values, state.x[0][order])
        gap = [np.linalg.norm((state.force[0] - force)[block]) for block in model.blocks()]
        miss = (np.array(gap) - row.loss[list(model.ranges)]) / check.sd
        return np.where(np.isfinite(miss), miss, np.inf)

    def miss_of(j: int) -> Callable[[float], Array]:
        return lambda value: miss([*row.values[:j], value, *row.values[j + 1 :]])

    found = []
    for j, name in enumerate(row.names):
        best = _best_value(miss_of(j), row.values[j])
        if best is not None:
            found.append(Correction(name, row.parameters[j], _shortest(*best), *best))
    return found


def _best_value(miss: Callable[[float], Array], printed: float) -> tuple[float, float] | None:
    """The value with the smallest misses and its standard deviation; None if some loss still disagrees.

    The misses are far from linear over the range of values tried, so every dip of their interpolant is followed up.
    """
    if printed == 0:
        return None
    values = np.sort(printed * FACTORS)
    misses = np.array([miss(float(v)) for v in values])
    good = np.all(np.isfinite(misses), axis=1)
    if np.count_nonzero(good) < 4:
        return None
    fine = np.linspace(values[good][0], values[good][-1], FINE)
    cost = np.sum(CubicSpline(values[good], misses[good])(fine) ** 2, axis=1)
    dips = fine[1:-1][(cost[1:-1] <= cost[:-2]) & (cost[1:-1] <= cost[2:])]
    dips = dips[np.argsort(np.interp(dips, fine, cost))][:DIPS]
    refined = [_refine(miss, float(v), abs(printed)) for v in dips]
    fits = [r for r in refined if np.all(np.abs(miss(r[0])) <= AGREES)]
    return min(fits, key=lambda r: float(np.sum(miss(r[0]) ** 2))) if fits else None


def _refine(miss: Callable[[float], Array], value: float, scale: float) -> tuple[float, float]:
    """Gauss-Newton on one parameter: the value and its standard deviation."""
    step, slope = 1e-5 * scale, np.ones(1)
    for _ in range(30):
        base, ahead = miss(value), miss(value + step)
        if not (np.all(np.isfinite(base)) and np.all(np.isfinite(ahead))):
            break
        slope = (ahead - base) / step
        if not np.any(slope):
            break
        change = -float(slope @ base) / float(slope @ slope)
        value += float(np.clip(change, -0.02 * scale, 0.02 * scale))
        if abs(change) < 1e-8 * scale:
            break
    return value, 1.0 / max(float(np.linalg.norm(slope)), 1e-300)


def _shortest(best: float, sd: float) -> float:
    """The number with the fewest digits within two standard deviations of ``best``."""
    for digits in range(1, 17):
        short = float(f"{best:.{digits}g}")
        if abs(short - best) <= 2 * sd:
            return short
    return best


def _edits(corrections: tuple[Correction, ...]) -> int:
    """How many characters of the printed numbers change: digits, sign, decimal point."""
    return sum(_distance(c.printed.rstrip("0"), f"{c.consistent:.12g}") for c in corrections)


def _distance(a: str, b: str) -> int:
    """Edit distance of two texts, an exchange of neighbours counted once."""
    table = np.add.outer(np.arange(len(a) + 1), np.arange(len(b) + 1))
    for i, j in ((i, j) for i in range(1, len(a) + 1) for j in range(1, len(b) + 1)):
        same = a[i - 1] == b[j - 1]
        table[i, j] = min(table[i - 1, j] + 1, table[i, j - 1] + 1, table[i - 1, j - 1] + (not same))
        if i > 1 and j > 1 and a[i - 1] == b[j - 2] and a[i - 2] == b[j - 1]:
            table[i, j] = min(table[i, j], table[i - 2, j - 2] + 1)
    return int(table[-1, -1])
