"""Modes of the reconstruction's posterior and their evidence: trilateration, damped Gauss-Newton, Laplace."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, logit

from bayesmembrane.ground.parameters import Array
from bayesmembrane.reconstruction.model import CurveState, Knobs, LossModel

LOOSEN = (64.0, 16.0, 4.0, 1.0)  # errors are first taken as larger than they are: the way to the mode is then smooth
ROUNDS = 8
MOST_STEPS, MOST_TRIES = 200, 15
LEAST_GAIN, ROUGH_GAIN = 1e-4, 1e-2  # gain of the log posterior at which a mode is found, and nearly found
SHARES = (0.3, 0.05, 0.8)  # first positions, in parts of the largest, from which the mode is looked for


class Mode(NamedTuple):
    """The most probable unknowns.

    Attributes
    ----------
    theta : (P,) unknowns
    value : ln p(losses, theta)
    precision : (P, P) its negative curvature, Gauss-Newton with the weights of the Student t
    evidence : ln p(losses), Laplace's approximation
    knobs : the settings it belongs to
    """

    theta: Array
    value: float
    precision: Array
    evidence: float
    knobs: Knobs

    def covariance(self) -> Array:
        """(P, P) covariance of the unknowns in Laplace's approximation."""
        return np.asarray(np.linalg.inv(self.precision), dtype=float)


def knobs_at(roughness: float, nugget: float, rounding: float, solver: tuple[float, ...]) -> Knobs:
    """One setting of the scales."""
    return Knobs(np.array([roughness]), np.array([nugget]), np.array([solver]), np.array([rounding]))


def find_mode(model: LossModel, knobs: Knobs) -> Mode:
    """The best of the modes that trilateration at several first positions leads to."""
    theta, settings = _starts(model, knobs), together([knobs] * len(SHARES))
    for loosen in LOOSEN:
        modes = climb(model, theta, settings, loosen, ROUGH_GAIN)
        theta = np.array([m.theta for m in modes])
    best = max(modes, key=lambda m: m.value)
    return climb(model, best.theta[None], knobs)[0]


def descend(model: LossModel, knobs: list[Knobs]) -> list[Mode]:
    """The modes at settings that allow for ever smaller errors, each started from the one before."""
    theta, path = _starts(model, knobs[0]), []
    for k in knobs:
        modes = climb(model, theta, together([k] * len(SHARES)), least=ROUGH_GAIN)
        theta = np.array([m.theta for m in modes])
        path.append(max(modes, key=lambda m: m.value))
    return path


def _starts(model: LossModel, knobs: Knobs) -> Array:
    return np.array([trilaterate(model, knobs, np.full(len(model.ranges), share)) for share in SHARES])


def trilaterate(model: LossModel, knobs: Knobs, share: Array) -> Array:
    """Unknowns (P,) near the mode, from equations that are linear in the measured forces y,

        L_k^2 = |y|^2 - 2 F_k . y + |F_k|^2,

    with |y|^2 as an unknown of its own, y linearised about the smooth curve, and rows weighted down that do not fit.
    """
    nb, count = model.curve.size, len(model.ranges)
    x, _, _, _ = model.positions(logit(share)[None])
    force = model.simulations.forces(x)[0][0]
    usable = force[:, model.use & model.simulations.usable]
    size = np.ravel(knobs.roughness)[:1]
    c = model.curve.nearest(x[0], np.median(usable, axis=1), np.zeros(nb))
    scale = model.error_scale(knobs, 1).reshape(count, -1) * LOOSEN[1]
    weight = np.tile(model.use.astype(float), (count, 1))
    for _ in range(ROUNDS):
        y, _, moved = (v[0] for v in model.curve.force(c[None], size, x))
        a = np.zeros((count, force.shape[1], nb + count))
        b = np.empty((count, force.shape[1]))
        for i, block in enumerate(model.blocks()):
            loss = model.losses[model.ranges[i]]
            part = force[block].T
            a[i, :, :nb], a[i, :, nb + i] = -2 * part @ moved[block], 1.0
            b[i] = loss**2 - np.sum(part**2, 1) + 2 * part @ (y[block] - moved[block] @ c)
            a[i] /= 2 * (loss * scale[i])[:, None]
            b[i] /= 2 * loss * scale[i]
        new = _robust_lines(a.reshape(-1, nb + count), b.ravel(), weight.ravel(), nb, model.tail)[:nb]
        c = c + model.curve.stride(moved, y, new - c) * (new - c)
    theta = np.zeros(model.size)
    theta[:nb], theta[-count:] = c, logit(share)
    return theta


def _robust_lines(a: Array, b: Array, believed: Array, priors: int, tail: float) -> Array:
    """Solution of a s = b with Student-t errors of scale 1 and a standard normal prior on the first unknowns."""
    prior = np.concatenate([np.ones(priors), np.full(a.shape[1] - priors, 1e-12)])
    weight = believed
    for _ in range(ROUNDS):
        s = np.asarray(np.linalg.solve((a.T * weight) @ a + np.diag(prior), a.T @ (weight * b)), dtype=float)
        weight = believed * (tail + 1) / (tail + (a @ s - b) ** 2)
    return s


def climb(model: LossModel, theta: Array, knobs: Knobs, loosen: float = 1.0, least: float = LEAST_GAIN) -> list[Mode]:
    """Damped Gauss-Newton from each of ``theta`` (B, P), with B settings of the scales.

    Every step raises the posterior density, or the climb is over.
    """
    here = _look(model, theta, knobs, loosen)
    damping, tries = np.full(len(theta), 1e-3), np.zeros(len(theta), dtype=int)
    going = np.isfinite(here.value)
    for _ in range(MOST_STEPS):
        at = np.flatnonzero(going)
        if not at.size:
            break
        there = _look(model, _step(model, here.take(at), damping[at]), knobs.take(at), loosen)
        gain = np.where(np.isfinite(there.value), there.value - here.value[at], -np.inf)
        up = gain > 0
        here.put(at[up], there.take(up))
        damping[at] = np.where(up, np.maximum(damping[at] / 10, 1e-10), np.maximum(damping[at], 1e-7) * 5)
        tries[at] = np.where(up, 0, tries[at] + 1)
        going[at] = np.where(up, gain >= least, tries[at] < MOST_TRIES)
    spread = 0.5 * theta.shape[1] * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(here.precision)[1]
    return [
        Mode(here.theta[i], float(here.value[i]), here.precision[i], float(here.value[i] + spread[i]), knobs.take([i]))
        for i in range(len(theta))
    ]


def _step(model: LossModel, here: _Look, damping: Array) -> Array:
    """Unknowns (B, P) one damped step further; no first position moves by more than one in its logit."""
    diagonal = np.einsum("bpp->bp", here.precision) * damping[:, None]
    matrix = here.precision + diagonal[:, :, None] * np.eye(diagonal.shape[1])
    step = np.linalg.solve(matrix, here.gradient[:, :, None])[:, :, 0]
    longest = np.max(np.abs(step[:, -len(model.ranges) :]), axis=1)
    return np.asarray(here.theta + step / np.maximum(1.0, longest)[:, None])


class _Look(NamedTuple):
    """Unknowns (B, P), log posterior (-inf where there is none), its gradient, and its negative curvature."""

    theta: Array
    value: Array
    gradient: Array
    precision: Array

    def take(self, index: NDArray[Any]) -> _Look:
        """Those at ``index``."""
        return _Look(*(v[index] for v in self))

    def put(self, index: NDArray[Any], other: _Look) -> None:
        """Replace those at ``index``."""
        for mine, theirs in zip(self, other, strict=True):
            mine[index] = theirs


def curvature(model: LossModel, theta: Array, state: CurveState, knobs: Knobs, loosen: float) -> Array:
    """(B, P, P) Gauss-Newton curvature of -ln p(losses, theta), with the weights of the Student t."""
    scale = model.error_scale(knobs, len(theta)) * loosen
    weight = model.weights(state.residual / scale)[0] / scale**2
    share = expit(theta[:, -len(model.ranges) :])
    prior = np.concatenate([np.ones((len(theta), theta.shape[1] - share.shape[1])), 2 * share * (1 - share)], axis=1)
    jacobian = np.swapaxes(state.jacobian * weight[:, :, None], 1, 2) @ state.jacobian
    return np.asarray(jacobian + prior[:, :, None] * np.eye(theta.shape[1]))


def _look(model: LossModel, theta: Array, knobs: Knobs, loosen: float) -> _Look:
    with np.errstate(all="ignore"):
        state = model.evaluate(theta, knobs)
        value, gradient = model.log_density(theta, state, knobs, loosen)
    good = np.isfinite(value) & np.all(np.isfinite(gradient), axis=1)
    precision = curvature(model, theta, state, knobs, loosen)
    precision = np.where(good[:, None, None], precision, np.eye(theta.shape[1]))
    return _Look(theta.copy(), np.where(good, value, -np.inf), np.where(good[:, None], gradient, 0.0), precision)


# ---- scales that are not known beforehand ----------------------------------------------------------------------------


def scan(model: LossModel, grid: list[Knobs], start: Mode, least: float = LEAST_GAIN) -> list[Mode]:
    """The modes at all settings of the scales, each from ``start``."""
    return climb(model, np.array([restart(model, start, k) for k in grid]), together(grid), least=least)


def again(model: LossModel, mode: Mode, knobs: Knobs | None = None) -> Mode:
    """The mode of a model that differs a little from the one that ``mode`` belongs to, or at other scales."""
    knobs = mode.knobs if knobs is None else knobs
    return climb(model, restart(model, mode, knobs)[None], knobs)[0]


def together(knobs: Sequence[Knobs]) -> Knobs:
    """Settings one after the other."""
    return Knobs(*(np.concatenate([np.atleast_1d(k[i]) for k in knobs]) for i in range(4)))


def restart(model: LossModel, mode: Mode, knobs: Knobs) -> Array:
    """The unknowns of a mode in the units of other scales, so that the smooth curve stays where it is."""
    theta = mode.theta.copy()
    theta[model.curve.free] *= np.ravel(mode.knobs.roughness)[0] / np.ravel(knobs.roughness)[0]
    return theta


def knob_grid(
    roughness: tuple[float, ...],
    nugget: tuple[float, ...],
    rounding: tuple[float, ...],
    solver: tuple[float, ...],
    ranges: int,
) -> list[Knobs]:
    """All combinations; the solver's error is a matter of each range."""
    return [knobs_at(r, g, q, s) for r, g, q, s in product(roughness, nugget, rounding, product(solver, repeat=ranges))]
