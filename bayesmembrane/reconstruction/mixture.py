"""One curve under several families: the evidence of each, and what all of them say together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit, logit, logsumexp, ndtri, softmax

from bayesmembrane.data.published import PublishedTable
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import material
from bayesmembrane.ground.sobol import scrambled_sobol
from bayesmembrane.reconstruction.families.base import CurveFamily
from bayesmembrane.reconstruction.families.displaced import Displaced
from bayesmembrane.reconstruction.families.energy import EnergyCurve, NoFilmError, standard
from bayesmembrane.reconstruction.families.smooth_force import SmoothForce
from bayesmembrane.reconstruction.families.smooth_logarithm import SmoothLogarithm
from bayesmembrane.reconstruction.fit import ROUGH_GAIN, Mode, climb, find_mode, scan, together
from bayesmembrane.reconstruction.model import CurveState, Knobs, LossModel
from bayesmembrane.reconstruction.scales import all_scales, middle, solver_scales
from bayesmembrane.reconstruction.simulations import Simulate, Simulations

# What the evidence of a family is worth: widths of priors are conventions, and a factor of two in a few of them, with
# Laplace's error, is this much in its logarithm.
EVIDENCE_SD = 2.0
HOPELESS = 25.0  # ln evidence below the best at which a family is out, whatever its scales
# Families whose evidences are no further apart than three standard deviations of a difference are not told apart, and
# none of them has less than this part of the weight.
TOLD_APART = 3 * np.sqrt(2) * EVIDENCE_SD
LEAST = 0.05
BEHIND = 2.0  # ... at which it looks again
UNLIKELY = 12.0  # the same for a size of its smooth part
LOOSEN = (4.0, 1.0)
ROUNDS = 8
TRIALS = 14  # log2 of the number of evidences that could as well have come out


@dataclass(frozen=True)
class Placed:
    """A family at the losses.

    Attributes
    ----------
    model : the posterior with its curves, where its expansion, if it is one, is made at the mode
    modes : at all settings of the scales; those in the middle alone where the family is out
    log_evidence : ln p(losses), averaged over the settings
    """

    model: LossModel
    modes: tuple[Mode, ...]
    log_evidence: float

    @property
    def family(self) -> CurveFamily:
        """The family of curves."""
        return self.model.curve

    @property
    def best(self) -> Mode:
        """The mode at the most probable setting."""
        return max(self.modes, key=lambda m: m.evidence)


def families(table: PublishedTable, simulations: Simulations, simulate: Simulate, near: Array) -> list[CurveFamily]:
    """Every family that the curve could be of: smooth ones, and one for each energy of the table.

    An energy starts from that printed row whose curve is nearest to ``near`` (2, N), deflections in m and forces in N.
    """
    logarithm = SmoothLogarithm(simulations)
    found: list[CurveFamily] = [logarithm, Displaced(logarithm), SmoothForce(simulations)]
    top, names = float(max(simulations.ends)), dict.fromkeys(row.material for row in table.rows)
    x, force = near[0], np.maximum(near[1], 1e-3)[:, None]
    miss = np.sum(force * np.log(simulations.forces(x)[0] / force) ** 2, axis=0)
    for name in names:
        rows = [k for k, row in enumerate(table.rows) if row.material == name and simulations.usable[k]]
        starts = [standard(material(name), np.array(table.rows[k].values)) for k in sorted(rows, key=lambda k: miss[k])]
        found += _first_film(name, simulate, top, [at for at in starts if np.all(np.isfinite(at))])
    return found


def _first_film(name: str, simulate: Simulate, top: float, starts: list[Array]) -> list[CurveFamily]:
    """The family of an energy about the first start that has films on all sides; none if there is no such start."""
    for at in starts:
        try:
            return [EnergyCurve(material(name), simulate, top, at)]
        except NoFilmError:
            continue
    return []


def place_all(model: LossModel, candidates: Sequence[CurveFamily], start: Mode) -> list[Placed]:
    """The modes of all families, each from the curve that ``start``, a mode of ``model``, has found, and from others.

    Curves that meet the losses may lie in different places: a smooth family also looks for its own, and one that is
    behind looks again from where the best one is.
    """
    found = []
    for family in candidates:
        placed = place(model, family, start)
        if family.ready:
            own = replace(model, curve=family)
            mode = find_mode(own, middle(family, len(model.ranges)))
            placed = max(placed, place(own, family, mode), key=lambda p: p.log_evidence)
        found.append(placed)
    best = max(found, key=lambda p: p.log_evidence)
    return [
        max(p, place(best.model, p.family, best.best), key=lambda q: q.log_evidence)
        if best.log_evidence - HOPELESS < p.log_evidence < best.log_evidence - BEHIND
        else p
        for p in found
    ]


def place(model: LossModel, family: CurveFamily, start: Mode) -> Placed:
    """The modes of a family at all its sizes, other scales in the middle; ``start`` is a mode of ``model``."""
    state = model.evaluate(start.theta[None], start.knobs)
    knobs, firsts = middle(family, len(model.ranges)), start.theta[-len(model.ranges) :]
    family, c = family.placed(state.x[0], state.smooth[0])
    for loosen in LOOSEN:
        model, mode = _climb_with(model, family, c, firsts, knobs, loosen)
        c, firsts = mode.theta[: family.size], mode.theta[-len(model.ranges) :]
    for _ in range(ROUNDS):
        modes = scan(model, [knobs._replace(roughness=np.array([size])) for size in family.sizes], mode, ROUGH_GAIN)
        mode = max(modes, key=lambda m: m.evidence)
        c, firsts, knobs = mode.theta[: family.size], mode.theta[-len(model.ranges) :], mode.knobs
        family, done = family.settled(c)
        if done:
            break
        model, mode = _climb_with(model, family, c, firsts, knobs)
    return Placed(model, tuple(modes), mode.evidence)


def _climb_with(
    model: LossModel, family: CurveFamily, c: Array, firsts: Array, knobs: Knobs, loosen: float = 1.0
) -> tuple[LossModel, Mode]:
    model = replace(model, curve=family)
    theta = np.zeros(model.size)
    theta[: family.size], theta[-firsts.size :] = c, firsts
    return model, climb(model, theta[None], knobs, loosen, ROUGH_GAIN)[0]


def weigh(placed: Sequence[Placed]) -> list[Placed]:
    """The families at all settings of their scales, with their evidence; those that are out stay as they are."""
    best = max(p.best.evidence for p in placed)
    return [_scanned(p) if p.best.evidence > best - HOPELESS else p for p in placed]


def _scanned(placed: Placed) -> Placed:
    """At all settings but those whose size of the smooth part is out."""
    top, ranges = placed.best.evidence, len(placed.model.ranges)
    grid = all_scales(placed.family, ranges)
    likely = {_size(m.knobs) for m in placed.modes if m.evidence > top - UNLIKELY}
    modes = scan(placed.model, [k for k in grid if _size(k) in likely], placed.best, ROUGH_GAIN)
    evidence = float(logsumexp([m.evidence for m in modes]) - np.log(len(grid)))
    return Placed(placed.model, tuple(modes), evidence)


def _size(knobs: Knobs) -> float:
    return float(np.ravel(knobs.roughness)[0])


def relative_evidence(placed: Placed, counts: Sequence[tuple[int, ...]], firsts: Array) -> Array:
    """(M,) ln evidence of numbers of points ``counts`` under a family, relative to its own numbers.

    firsts : (M, R) m, where the first positions are looked for
    """
    own = placed.best
    grid = [own.knobs._replace(solver=k.solver) for k in solver_scales(placed.family, len(placed.model.ranges))]
    found = []
    for n, first in zip([placed.model.counts, *counts], [None, *firsts], strict=True):
        model = replace(placed.model, counts=n)
        theta = np.zeros(model.size)
        theta[: placed.family.size] = own.theta[: placed.family.size]
        share = np.clip(first / model.reach, 1e-3, 1 - 1e-3) if first is not None else None
        theta[-len(n) :] = own.theta[-len(n) :] if share is None else logit(share)
        modes = climb(model, np.tile(theta, (len(grid), 1)), together(grid), least=ROUGH_GAIN)
        found.append(float(logsumexp([m.evidence for m in modes])))
    return np.array(found[1:]) - found[0]


def probabilities(log_evidence: Sequence[float]) -> Array:
    """(K,) probabilities of families that are equally probable beforehand: p_k = l_k + (1 - sum l) E[Z_k / sum Z].

    The mean is over independent normal errors of `EVIDENCE_SD`: it keeps a family in the mixture whose evidence is
    lower by no more than the choice of a prior's width can change it. Quasi-random, so always the same. l is that of
    `least_probabilities`.
    """
    least = least_probabilities(log_evidence)
    points = scrambled_sobol(len(log_evidence), 0).random_base2(TRIALS)
    trials = np.asarray(log_evidence) + EVIDENCE_SD * ndtri(np.clip(points, 1e-9, 1 - 1e-9))
    weighed = np.asarray(np.mean(softmax(trials, axis=1), axis=0), dtype=float)
    return least + (1 - np.sum(least)) * weighed


def least_probabilities(log_evidence: Sequence[float]) -> Array:
    """(K,) what a family has whatever its evidence: `LEAST`, or 0 if it is further than `TOLD_APART` below the best.

    Evidences by other means scatter by more than the differences between families that meet the losses. Then the
    forces that one of them allows are possible, whatever its rank.
    """
    near = np.asarray(log_evidence) > np.max(log_evidence) - TOLD_APART
    return np.where(near, min(LEAST, 1 / np.count_nonzero(near)), 0.0)


# ---- what they say together ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Told:
    """What one family says.

    Attributes
    ----------
    force, covariance : (N,) N and (N, N) N^2, of the forces at given deflections
    first, first_covariance : (R,) m and (R, R) m^2, of the first positions
    """

    force: Array
    covariance: Array
    first: Array
    first_covariance: Array


def tell(placed: Placed, x: Array) -> Told:
    """Moments of the forces at deflections x (N,) in m and of the first positions: those of all modes together.

    Each mode is a Gaussian. Forces move along their own smooth curve to x: what is asked is the force at one
    deflection, so what is not known of the positions is not part of it.
    """
    model, evidence = placed.model, np.array([m.evidence for m in placed.modes])
    share, parts = np.exp(evidence - logsumexp(evidence)), []
    for mode in placed.modes:
        theta, covariance = mode.theta[None], mode.covariance()
        state = model.evaluate(theta, mode.knobs)
        force = moved(model, theta, mode.knobs, state, x)[0]
        rates = state.force_jacobian[0].copy()
        rates[:, -len(model.ranges) :] = 0.0
        size = model.curve.size
        rates[:, :size] = model.smooth(theta, mode.knobs, x[None])[2][0]
        parts.append((force, rates @ covariance @ rates.T, *_firsts(model, mode, covariance)))
    columns = [np.array(c) for c in zip(*parts, strict=True)]
    return Told(*mixture(columns[0], columns[1], share), *mixture(columns[2], columns[3], share))


def _firsts(model: LossModel, mode: Mode, covariance: Array) -> tuple[Array, Array]:
    """Mean (R,) and covariance (R, R) of the first positions, m: their logits are normal; independent."""
    ranges = len(model.ranges)
    nodes, weight = np.polynomial.hermite_e.hermegauss(31)
    spread = np.sqrt(np.diag(covariance)[-ranges:])
    first = model.reach * expit(mode.theta[-ranges:] + nodes[:, None] * spread)
    mean = weight @ first / np.sum(weight)
    return mean, np.diag(weight @ (first - mean) ** 2 / np.sum(weight))


def moved(model: LossModel, theta: Array, knobs: Knobs, state: CurveState, x: Array) -> Array:
    """Forces (B, N) of ``state``, which is that of unknowns (B, P), moved along its smooth curves to x (N,)."""
    there = model.smooth(theta, knobs, np.broadcast_to(x, state.x.shape))[0]
    return np.asarray(state.force + there - state.smooth)


def mixture(means: Array, covariances: Array, share: Array) -> tuple[Array, Array]:
    """Mean (N,) and covariance (N, N) of a mixture: means (K, N), covariances (K, N, N), shares (K,) that add up to 1.

    Within and between: sum_k p_k (C_k + (m_k - m)(m_k - m)^T).
    """
    mean = share @ means
    off = means - mean
    return np.asarray(mean), np.asarray(np.tensordot(share, covariances, axes=1) + (off.T * share) @ off)
