"""Least squares among the films that meet the convexity prior."""

from __future__ import annotations

import numpy as np
from scipy.optimize import Bounds, NonlinearConstraint, minimize

from bayesmembrane.calibration.objective import Objective, separated
from bayesmembrane.calibration.prior import JointPrior
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.mechanics.solution import Status

STARTS = 2
MOST_ITERATIONS, TOLERANCE = 50, 1e-7


def constrained_optimum(objective: Objective, pool: Array, free: Array, contained: list[Array]) -> Array | None:
    """x (k,) of the least |r(x)| among films that meet the convexity prior, None if none was found.

    ``pool`` (M, k) are starts, the best first, ``free`` (k,) is the optimum without the constraint, ``contained`` are
    the optima (k,) of simpler energies.
    """
    feasible = _feasible(objective, pool)
    simple = _feasible(objective, np.array(contained)) if contained else feasible[:0]
    if not len(feasible) + len(simple):
        return None
    anchor = feasible[0] if len(feasible) else simple[0]
    starts = [*separated(feasible, objective.spread, STARTS - 1), _pulled_inside(objective, free, anchor), *simple]
    found = [_pulled_inside(objective, _constrained_search(objective, s), anchor) for s in starts]
    found += list(simple)
    sizes = objective.many(objective.forward(np.array(found), reached=False))
    best = int(np.argmin(sizes))
    return np.asarray(found[best]) if np.isfinite(sizes[best]) else None


def _feasible(objective: Objective, x: Array) -> Array:
    """Those of x (M, k) that have a curve and meet the convexity prior."""
    prediction = objective.forward(x)
    inside = JointPrior(objective.hypothesis).inside(prediction)
    return np.asarray(x[inside & np.isfinite(objective.many(prediction))])


def _constrained_search(objective: Objective, start: Array) -> Array:
    """Sequential quadratic programming for min |r|^2 with all margins >= 0, from start (k,)."""
    scale = max(float(np.linalg.norm(objective(start)[0])) ** 2, 1e-300)

    def value(x: Array) -> float:
        r = objective(x)[0]
        return float(r @ r / scale) if np.all(np.isfinite(r)) else 1e6

    def slope(x: Array) -> Array:
        r, jacobian = objective(x)
        return np.asarray(np.nan_to_num(2 * r @ jacobian / scale, posinf=0.0, neginf=0.0))

    count = _margins(objective, start[None, :]).shape[1]

    def margins(x: Array) -> Array:
        return np.asarray(_as_many(_margins(objective, x[None, :]), count)[0])

    def margin_slopes(x: Array) -> Array:
        h = 1e-5 * objective.spread
        both = _as_many(_margins(objective, np.concatenate([x + np.diag(h), x - np.diag(h)])), count)
        return np.asarray((both[: x.size] - both[x.size :]).T / (2 * h))

    done = minimize(
        value,
        start,
        jac=slope,
        method="SLSQP",
        bounds=Bounds(objective.low, objective.high),
        constraints=NonlinearConstraint(margins, 0.0, np.inf, jac=margin_slopes),
        options={"maxiter": MOST_ITERATIONS, "ftol": TOLERANCE},
    )
    return np.asarray(np.clip(done.x, objective.low, objective.high))


def _margins(objective: Objective, x: Array) -> Array:
    """Convexity margins (B, M) of x (B, k), one for each deflection or one for the box; 1 where there is no state."""
    h = objective.hypothesis
    values = h.convexity.margins_at(objective.forward(x), h.material)
    return np.where(np.isnan(values), 1.0, np.clip(values, -1e3, 1e3))


def _as_many(margins: Array, count: int) -> Array:
    """(B, count) of margins (B, M) along the way: films that are lifted farther are solved at more places."""
    if margins.shape[1] == count:
        return margins
    place, here = np.linspace(0.0, 1.0, count), np.linspace(0.0, 1.0, margins.shape[1])
    return np.stack([np.interp(place, here, row) for row in margins])


def _pulled_inside(objective: Objective, x: Array, anchor: Array) -> Array:
    """The point nearest to x on the way to ``anchor`` that meets the convexity prior and has a curve."""
    prior = JointPrior(objective.hypothesis)
    low, high = 0.0, 1.0
    for _ in range(4):
        t = np.concatenate([[low], low + (high - low) * np.geomspace(1e-6, 1.0, 15)])
        prediction = objective.forward(x + t[:, None] * (anchor - x))
        good = prior.inside(prediction) & np.all(prediction.status == Status.OK, axis=1)
        first = int(np.argmax(good)) if np.any(good) else t.size - 1
        if first == 0:
            return np.asarray(x + t[0] * (anchor - x))
        low, high = float(t[first - 1]), float(t[first])
    return np.asarray(x + high * (anchor - x))
