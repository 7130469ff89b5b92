"""Least squares: the global optimum of a hypothesis on a measurement, without and with the convexity prior's bound."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares, minimize

from bayesmembrane.errors import SettingsError, unknown_name
from bayesmembrane.forward import Forward, Prediction, Solve
from bayesmembrane.hypothesis import CONVEXITY, Hypothesis
from bayesmembrane.inference.descent import descend
from bayesmembrane.inference.posterior import enough_points
from bayesmembrane.inference.prior import JointPrior
from bayesmembrane.measurement import Measurement
from bayesmembrane.mechanics import api
from bayesmembrane.mechanics.solution import Status
from bayesmembrane.parameters import Array

LOSSES = ("euclidean", "weighted")
SCREENED, INFLATED, STARTED, POLISHED = 768, 256, 12, 2
INFLATION = 2.5
APART, DISTINCT = 1.5, 0.3  # least distance of starts, and of what they lead to, in prior standard deviations
HOPEFUL = 10.0  # a start that misses the data by this many times the best one's |r| is not followed
FEW, MOST = 50, 300  # evaluations of a first and of a last search
TO_BOUND = 40  # iterations towards a bound
NEAR = 1e-3  # of the width of the bounds: an estimate this close is at the bound
FLAT = 1e-4  # a loss that rises by less than this part on the way to the bound has no minimum before it


@dataclass(frozen=True)
class Estimate:
    """A fitted parameter; ``sd`` is None where the data set no scale (at a bound, or no degree of freedom left)."""

    value: float
    sd: float | None
    unit: str


@dataclass(frozen=True, eq=False)
class Fit:
    """The optimum of one loss.

    Attributes
    ----------
    hypothesis : what was fitted; its noise model plays no part
    loss : "euclidean" (|F - y|_2, the loss of the source paper) or "weighted" (by the measurement's own noise)
    coordinates : (k,) coordinates that shape the curve, at the optimum
    covariance : (k, k) of the coordinates, from the Jacobian and the residual variance; nan at a bound
    parameters : natural parameters by full name
    deflection, force : (N,) m and N, of the fitted curve
    loss_N, rmse_N, max_N : |F - y|_2, its root mean square, and the largest |F - y|, N
    objective : what was minimised: `loss_N`, or the root of the weighted sum of squares
    margins : by how much each convexity mode is met; below 0 it is not
    at_bound : coordinates without an optimum inside their bounds: the loss falls, or is flat, up to the bound
    status : "converged", or why the search ended
    constrained : the optimum among films that meet the convexity prior; this one if it does; None without any
    """

    hypothesis: Hypothesis
    loss: str
    coordinates: Array
    covariance: Array
    parameters: dict[str, Estimate]
    deflection: Array
    force: Array
    loss_N: float
    rmse_N: float
    max_N: float
    objective: float
    margins: dict[str, float]
    at_bound: tuple[str, ...]
    status: str
    constrained: Fit | None = field(default=None, repr=False)

    @property
    def convex(self) -> bool:
        """True if the hypothesis' convexity prior holds; for the mode "none", that of "reached"."""
        mode = self.hypothesis.convexity
        margin = self.margins["reached" if mode == "none" else mode]
        return margin > 0 if mode == "elliptic" else margin >= 0

    def summary(self) -> dict[str, Any]:
        """Plain values for the JSON answer of ``fit``; parameters under their short names."""
        short = {k.partition(".")[2]: {"value": e.value, "sd": e.sd} for k, e in self.parameters.items()}
        answer: dict[str, Any] = {
            "material": self.hypothesis.material.name,
            "loss": self.loss,
            "parameters": short,
            "rmse_N": self.rmse_N,
            "loss_N": self.loss_N,
            "max_N": self.max_N,
            "convex": self.convex,
            "margins": {k: v if np.isfinite(v) else None for k, v in self.margins.items()},
            "at_bound": list(self.at_bound),
            "status": self.status,
        }
        if self.constrained is not None and self.constrained is not self:
            answer["constrained"] = self.constrained.summary()
        return answer


def fit(
    measurement: Measurement,
    hypothesis: Hypothesis,
    *,
    loss: str = "euclidean",
    seed: int = 0,
    starts: Iterable[ArrayLike] = (),
    solve: Solve = api.solve,
) -> Fit:
    """The global minimum of |F(x) - y|_2, or of |L^-1 (F(x) - y)|_2 with the measurement's noise L L^T ("weighted").

    Draws from the prior, and from a wider one, are brought to their best modulus, which is linear; from the best ones
    that lie apart, and from ``starts`` (membrane parameters (n,), for example published ones), a trust-region method
    descends with exact derivatives, at first a little and then from the best ones to the end. Bounds are those of the coordinates, not the prior, which plays no part but for the
    convexity constraint. Ogden films are sought among those with c_i a_i > 0 only, which its coordinates cover.

    Standard errors are s^2 (J^T J)^-1 with s^2 = |r|^2 / (N - k): the misfit counts as noise.

    Raises `SettingsError` for fewer points than parameters, a loss that is unknown or lacks a noise, and a material
    whose films cannot reach the data.
    """
    enough_points(hypothesis, measurement)
    objective = Objective(hypothesis, measurement, loss, solve)
    rng = np.random.default_rng(seed)
    pool, size = objective.pool(rng)
    x, status = _global(objective, pool[size < HOPEFUL * size[0]], [np.asarray(s, dtype=float) for s in starts])
    free = objective.result(x, status)
    held = _constrained(objective, pool, free)
    if held is not None and held.objective < free.objective:
        # The constraint led to a better valley: it is open without the constraint too.
        x, _, status = objective.polish(held.coordinates)
        free = objective.result(x, status)
        held = held if not free.convex else free
    return replace(free, constrained=held)


class Objective:
    """r(x) = L^-1 (F(x) - y) of coordinates that shape the curve, with its Jacobian."""

    def __init__(self, hypothesis: Hypothesis, measurement: Measurement, loss: str, solve: Solve) -> None:
        if loss not in LOSSES:
            raise unknown_name("loss", loss, LOSSES)
        covariance = measurement.noise_covariance
        if loss == "weighted" and covariance is None:
            raise SettingsError(
                'the loss "weighted" needs the noise of the measurement, and it states none',
                remedy='give force_sd_N in the specimen file, or use "euclidean"',
            )
        self.hypothesis, self.measurement, self.loss = hypothesis, measurement, loss
        self.root = np.linalg.cholesky(covariance) if loss == "weighted" and covariance is not None else None
        self.forward = Forward(hypothesis, measurement, measurement.deflection, solve)
        self.parameters = hypothesis.parameters[: hypothesis.curve_size]
        self.low, self.high = np.array([p.bounds for p in self.parameters], dtype=float).T
        self._last: tuple[Array, Array, Array] | None = None

    def whiten(self, r: Array) -> Array:
        """L^-1 r along the first axis of r (N, ...)."""
        return r if self.root is None else np.asarray(solve_triangular(self.root, r, lower=True, check_finite=False))

    def batch(self, x: Array) -> tuple[Array, Array]:
        """r (B, N) and J (B, N, k) of x (B, k); nan where there is no curve."""
        p = self.forward(x, sensitivities=True, reached=False)
        assert p.sensitivity is not None
        r, j = p.force - self.measurement.force, p.sensitivity
        if self.root is None:
            return r, j
        wide = np.concatenate([r[:, :, None], j], axis=2)
        white = self.whiten(np.moveaxis(wide, 1, 0).reshape(r.shape[1], -1))
        white = np.moveaxis(white.reshape(r.shape[1], *wide.shape[::2]), 0, 1)
        return white[:, :, 0], white[:, :, 1:]

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """(r (N,), J (N, k)) of one x (k,), remembered: a search asks for them one after the other."""
        if self._last is None or not np.array_equal(self._last[0], x):
            r, j = self.batch(x[None, :])
            self._last = (x.copy(), r[0], j[0])
        return self._last[1], self._last[2]

    def whiten(self, r: Array) -> Array:
        """L^-1 r along the first axis of r (N, ...)."""
        return r if self.root is None else np.asarray(solve_triangular(self.root, r, lower=True, check_finite=False))

    def many(self, prediction: Prediction) -> Array:
        """|r| (B,); inf where there is no curve."""
        size = np.linalg.norm(self.whiten((prediction.force - self.measurement.force).T), axis=0)
        return np.where(np.isnan(size), np.inf, size)

    def rescaled(self, films: Array) -> tuple[Array, Array]:
        """Coordinates (M, k) of the films (B, n) that reach the data, at the modulus that fits best, and |r| (M,).

        F(s c) = s F(c), so that s = <F, y> / <F, F> is exact.
        """
        scales = np.asarray(self.hypothesis.material.scales)
        force = self.whiten(self.forward.curves(films, self.measurement.deflection).force.T)
        y = self.whiten(self.measurement.force)
        with np.errstate(all="ignore"):
            s = y @ force / np.sum(force**2, axis=0)
            size = np.linalg.norm(s * force - y[:, None], axis=0)
            x = self.hypothesis.material.to_coordinates((films * np.where(scales == 1, s[:, None], 1.0)).T).T
            n = x.shape[1]
            good = np.all((x >= self.low[:n]) & (x <= self.high[:n]), axis=1) & (s > 0) & np.isfinite(size)
        return x[good], size[good]

    def pool(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Rescaled draws (M, k) and their |r| (M,), the best first: of the prior and of a wider one, or of the bounds."""
        n, k = self.hypothesis.material_size, self.hypothesis.curve_size
        prior = JointPrior(self.hypothesis).draw(rng, SCREENED + INFLATED)[:, :k]
        prior[SCREENED:] = self.centre + INFLATION * (prior[SCREENED:] - self.centre)
        anywhere = rng.uniform(self.low, self.high, prior.shape)
        for candidates in (np.clip(prior, self.low, self.high), anywhere):
            start, size = self.rescaled(self.hypothesis.films(candidates))
            if len(start):
                # Draws of the effects are independent of those of the material: any of them will do.
                start = np.concatenate([start, candidates[: len(start), n:]], axis=1)
                order = np.argsort(size, kind="stable")
                return start[order], size[order]
        raise SettingsError(
            f"no {self.hypothesis.label()} film with admissible parameters reaches "
            f"{1e3 * np.max(self.measurement.deflection):g} mm",
            remedy="use a shorter range or another material, and check the units of the deflection",
        )

    @cached_property
    def centre(self) -> Array:
        """Prior medians (k,)."""
        return np.array([float(p.prior.quantile(0.5)) for p in self.parameters])

    @cached_property
    def spread(self) -> Array:
        """Prior standard deviations (k,): the scale on which starts lie apart."""
        return np.array([float(p.prior.distribution().std()) for p in self.parameters])

    def polish(self, x: Array, evaluations: int = MOST, tolerance: float = 1e-8) -> tuple[Array, float, str]:
        """(x, |r|, status) after a trust-region search from x (k,)."""
        room = 1e-6 * (self.high - self.low)
        done = least_squares(
            lambda x: self(x)[0],
            np.clip(x, self.low + room, self.high - room),
            jac=lambda x: self(x)[1],
            bounds=(self.low, self.high),
            x_scale="jac",
            ftol=tolerance,
            xtol=tolerance,
            gtol=None,
            max_nfev=evaluations,
        )
        return done.x, float(np.sqrt(2 * done.cost)), "converged" if done.status > 0 else "evaluation limit"

    def result(self, x: Array, status: str) -> Fit:
        """Everything about the optimum x (k,)."""
        r, jacobian = self(x)
        prediction = self.forward(x)
        misfit = prediction.force[0] - self.measurement.force
        bound = self._at_bound(x, float(np.linalg.norm(r)))
        covariance = _covariance(r, jacobian, bound)
        return Fit(
            hypothesis=self.hypothesis,
            loss=self.loss,
            coordinates=x,
            covariance=covariance,
            parameters=self._estimates(x, covariance),
            deflection=self.measurement.deflection,
            force=prediction.force[0],
            loss_N=float(np.linalg.norm(misfit)),
            rmse_N=float(np.sqrt(np.mean(misfit**2))),
            max_N=float(np.max(np.abs(misfit))),
            objective=float(np.linalg.norm(r)),
            margins={m: float(prediction.margin(m, self.hypothesis)[0]) for m in CONVEXITY[:3]},
            at_bound=tuple(p.name for p, b in zip(self.parameters, bound, strict=True) if b),
            status=status,
        )

    def _at_bound(self, x: Array, size: float) -> Array:
        """(k,) True where the loss falls, or stays flat, up to a bound while the others follow."""
        near = np.minimum(x - self.low, self.high - x) < NEAR * (self.high - self.low)
        sd = np.sqrt(np.diag(_covariance(*self(x), np.zeros(x.size, bool))))
        open_ = np.flatnonzero(~near & ~(sd < 0.5 * self.spread))
        if open_.size:
            moved, held = np.tile(x, (2 * open_.size, 1)), np.zeros((2 * open_.size, x.size), bool)
            for row, (i, bound) in enumerate((i, b[i]) for i in open_ for b in (self.low, self.high)):
                moved[row, i], held[row, i] = bound, True
            _, reached = descend(self.batch, moved, self.low, self.high, TO_BOUND, held)
            near[open_] = np.min(reached.reshape(-1, 2), axis=1) < size * (1 + FLAT)
        return np.asarray(near)

    def _estimates(self, x: Array, covariance: Array) -> dict[str, Estimate]:
        """Natural parameters, with errors by d natural / d x."""
        h, n = self.hypothesis, self.hypothesis.material_size
        values = h.films(x[None, :])[0]
        jacobian = self.forward.jacobian(x[None, :])[0][:, :n]
        held = np.isnan(np.diag(covariance))
        inner = np.where(held[:n, None] | held[None, :n], 0.0, covariance[:n, :n])
        sd = np.sqrt(np.einsum("ij,jk,ik->i", jacobian, inner, jacobian))
        # A parameter that moves with a held coordinate has no error to speak of.
        sd[np.any((np.abs(jacobian) > 1e-9 * np.abs(values[:, None])) & held[:n], axis=1)] = np.nan
        every = np.concatenate([values, x[n:]]), np.concatenate([sd, np.sqrt(np.diag(covariance))[n:]])
        return {
            name: Estimate(float(value), float(s) if np.isfinite(s) else None, unit)
            for name, value, s, unit in zip(h.natural_names, *every, h.natural_units, strict=False)
        }


def _covariance(r: Array, jacobian: Array, held: Array) -> Array:
    """s^2 (J^T J)^-1 (k, k) without the coordinates that are ``held``, which are nan; nan if N = k."""
    k = jacobian.shape[1]
    out = np.full((k, k), np.nan)
    free = np.flatnonzero(~held)
    dof = len(r) - free.size
    if free.size and dof > 0:
        _, s, vt = np.linalg.svd(jacobian[:, free], full_matrices=False)
        with np.errstate(divide="ignore", over="ignore"):
            root = vt.T / np.maximum(s, 1e-150)
        out[np.ix_(free, free)] = root @ root.T * (r @ r) / dof
    return out


def _global(objective: Objective, pool: Array, published: list[Array]) -> tuple[Array, str]:
    """The best of all polished starts, (x, status)."""
    h = objective.hypothesis
    starts = apart(pool, objective.spread * APART, STARTED)
    for films in published:
        start = h.material.to_coordinates(h.material.from_vector(films).vector)
        if np.all(np.isfinite(start)):
            starts.append(np.concatenate([start, starts[0][h.material_size :]]))
    first = sorted((objective.polish(s, FEW, 1e-4) for s in starts if np.all(np.isfinite(objective(s)[0]))), key=_size)
    best = apart(np.array([x for x, _, _ in first]), objective.spread * DISTINCT, POLISHED)
    best_x, _, status = min((objective.polish(b) for b in best), key=_size)
    return best_x, status


def _size(found: tuple[Array, float, str]) -> float:
    return found[1]


def apart(pool: Array, distance: Array, count: int) -> list[Array]:
    """The first ``count`` rows of pool (M, k) that lie further from each other than ``distance`` (k,)."""
    chosen: list[Array] = []
    for x in pool:
        if all(np.max(np.abs(x - c) / distance) > 1 for c in chosen):
            chosen.append(x)
        if len(chosen) == count:
            break
    return chosen


# ---- with the convexity constraint -----------------------------------------------------------------------------------


def _constrained(objective: Objective, pool: Array, free: Fit) -> Fit | None:
    """The optimum among films that meet the convexity prior, None if none was found."""
    if objective.hypothesis.convexity == "none" or free.convex:
        return free
    prior = JointPrior(objective.hypothesis)
    prediction = objective.forward(pool)
    size, inside = objective.many(prediction), prior.inside(prediction)
    feasible = pool[inside & np.isfinite(size)]
    if not len(feasible):
        return None
    anchor = feasible[0]
    starts = [feasible[0], _pulled(objective, free.coordinates, anchor)]
    found = [_pulled(objective, _constrained_search(objective, s), anchor) for s in starts]
    sizes = objective.many(objective.forward(np.array(found), reached=False))
    return objective.result(found[int(np.argmin(sizes))], "converged")


def _constrained_search(objective: Objective, start: Array) -> Array:
    """Sequential quadratic programming for min |r|^2 with all margins >= 0, from start (k,)."""
    scale = max(float(np.linalg.norm(objective(start)[0])) ** 2, 1e-300)

    def value(x: Array) -> float:
        r = objective(x)[0]
        return float(r @ r / scale) if np.all(np.isfinite(r)) else 1e6

    def slope(x: Array) -> Array:
        r, jacobian = objective(x)
        g = 2 * r @ jacobian / scale
        return np.where(np.isfinite(g), g, 0.0)

    def margins(x: Array) -> Array:
        return _margins(objective, x[None, :])[0]

    def margin_slopes(x: Array) -> Array:
        h = 1e-5 * objective.spread
        both = _margins(objective, np.concatenate([x + np.diag(h), x - np.diag(h)]))
        return np.asarray((both[: x.size] - both[x.size :]).T / (2 * h))

    done = minimize(
        value,
        start,
        jac=slope,
        method="SLSQP",
        bounds=list(zip(objective.low, objective.high, strict=True)),
        constraints={"type": "ineq", "fun": margins, "jac": margin_slopes},
        options={"maxiter": 50, "ftol": 1e-7},
    )
    return np.asarray(np.clip(done.x, objective.low, objective.high))


def _margins(objective: Objective, x: Array) -> Array:
    """Convexity margins (B, M) of x (B, k), one for each deflection or one for the box; 1 where there is no state."""
    prediction, mode = objective.forward(x), objective.hypothesis.convexity
    if mode == "box":
        values = prediction.margin(mode, objective.hypothesis)[:, None]
    else:
        values = prediction.convexity_at if mode == "reached" else prediction.ellipticity_at
    return np.where(np.isnan(values), 1.0, np.clip(values, -1e3, 1e3))


def _pulled(objective: Objective, x: Array, anchor: Array) -> Array:
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
