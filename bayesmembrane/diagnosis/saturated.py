"""A reference that no physics could beat: smooth curves in deflection and on every leg, whatever they mean."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.stats import chi2, f, ncf, ncx2

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.whitening import FEW, OwnNoise, orthonormal
from bayesmembrane.ground.parameters import Array

SPLINE, PER_LEG = 20, 6
SHARE = 3  # points for each column of the reference, at least
SHORT_LEG = 12  # points; a shorter leg gets a constant only
REVERSAL = 0.05  # of a leg: how fast its start may relax
RELAXATIONS = (0.01, 0.03, 0.1, 0.3, 1.0)  # of a hold: how fast it may


@dataclass(frozen=True)
class LackOfFit:
    """F = [(RSS - RSS_saturated) / (p - k)] / s^2 of a model, and what is its probability if nothing is missing.

    ratio : F; 1 is what an adequate model has
    p_value : P(F >= ratio)
    chi2 : RSS over the noise's own variance
    dof : N - k
    extra, rest : degrees of freedom above and below in F; ``rest`` is inf where the noise is stated
    """

    ratio: float
    p_value: float
    chi2: float
    dof: int
    extra: int = 1
    rest: float = np.inf

    def p_if_left(self, part: float, before: LackOfFit) -> float:
        """P(F >= ratio) if ``part`` of the misfit that ``before`` shows were left: noncentral F or chi-square."""
        missing = part * max(before.ratio - 1, 0.0) * before.extra
        if missing == 0:
            return self.p_value
        if np.isinf(self.rest):
            return float(ncx2.sf(self.ratio * self.extra, self.extra, missing))
        return float(ncf.sf(self.ratio, self.extra, self.rest, missing))

    @property
    def reduced_chi2(self) -> float:
        """chi^2 / (N - k), by the measurement's own noise."""
        return self.chi2 / max(self.dof, 1)


def reference_basis(measurement: Measurement) -> Array:
    """(N, p): B-splines in the deflection; on each leg Legendre polynomials and a quick relaxation at its start; on
    each hold a constant and relaxations.

    Splines have no more columns than a third of the points, all together two thirds at most; splines come first, then
    what tells legs apart.
    """
    d = measurement.deflection
    room = max(len(measurement) // SHARE, 1)
    still = measurement.holds
    moving = np.delete(d, np.concatenate(still)) if still else d
    columns = [splines(d, min(SPLINE, room, max(np.unique(moving).size // 2, 1)), moving)]
    starts = np.flatnonzero(np.diff(measurement.leg.astype(int))) + 1
    legs = np.split(np.arange(d.size), starts)
    if len(legs) > 1:
        each = PER_LEG if columns[0].shape[1] + PER_LEG * len(legs) <= 2 * room else 1
        columns += [_on_leg(d, leg, each) for leg in legs]
    columns += [_on_hold(measurement.path.clock[measurement.on_path], hold) for hold in still]
    return np.concatenate(columns, axis=1)


def splines(d: Array, count: int, at: Array | None = None) -> Array:
    """Cubic B-splines of ``count`` degrees of freedom at deflections d (N,), with knots at quantiles of ``at`` or d."""
    if count < 4:
        return np.vander((d - d.mean()) / max(np.ptp(d), 1e-12), count)
    inner = np.quantile(np.unique(d if at is None else at), np.linspace(0, 1, count - 2)[1:-1])
    low, high = float(d.min()), float(d.max())
    knots = np.concatenate([[low] * 4, inner, [high] * 4])
    return np.asarray(BSpline.design_matrix(np.clip(d, low, high), knots, 3).toarray())


def _on_leg(d: Array, leg: NDArray[np.intp], count: int) -> Array:
    out = np.zeros((d.size, count))
    if count == 1 or leg.size < SHORT_LEG:
        out[leg, 0] = 1.0
        return out
    s = np.linspace(0.0, 1.0, leg.size)
    way = np.abs(d[leg] - d[leg[0]])
    if way[-1] > 0:
        s = way / way.max()
    out[leg, :-1] = legvander(2 * s - 1, count - 2)
    out[leg, -1] = np.exp(-s / REVERSAL)
    return out


def _on_hold(time: Array, hold: NDArray[np.intp]) -> Array:
    s = (time[hold] - time[hold[0]]) / max(float(np.ptp(time[hold])), 1e-300)
    out = np.zeros((time.size, 1 + len(RELAXATIONS)))
    out[hold] = np.column_stack([np.ones(hold.size), *(np.exp(-s / part) for part in RELAXATIONS)])
    return out


def lack_of_fit(residual: Array, slopes: Array, basis: Array, noise: OwnNoise) -> LackOfFit:
    """How much of ``residual`` (N,) the reference (N, p), together with the model's ``slopes`` (N, k), explains.

    The saturated residual sets the scale where the noise is inferred; where it is stated, that does. A curve too short
    for the reference to leave `FEW` degrees of freedom is judged by all that is left, if its noise is stated.
    """
    r, k = noise.white(residual), slopes.shape[1]
    q = orthonormal(noise.white(np.column_stack([basis, slopes])))
    rss, rest = float(r @ r), float(np.sum((r - q @ (q.T @ r)) ** 2))
    n, p = r.size, q.shape[1]
    extra = max(p - k, 1)
    if noise.stated:
        whole = noise.root is not None or n - p < FEW
        value, dof = (rss, max(n - k, 1)) if whole else (max(rss - rest, 0.0), extra)
        return LackOfFit(value / dof, float(chi2.sf(value, dof)), rss, n - k, dof)
    scale = max(rest / max(n - p, 1), 1e-300)
    ratio = max(rss - rest, 0.0) / extra / scale
    rest_dof = max(n - p, 1)
    return LackOfFit(float(ratio), float(f.sf(ratio, extra, rest_dof)), rss, n - k, extra, float(rest_dof))
