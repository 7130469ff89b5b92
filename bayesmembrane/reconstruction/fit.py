"""Mode, evidence and draws of the reconstruction's posterior: trilateration, damped Gauss-Newton, Hamiltonian steps."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.special import expit, logit, logsumexp

from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.reconstruction.model import MODES, CurveState, Knobs, LossModel, wiener_basis

LOOSEN = (64.0, 16.0, 4.0, 1.0)  # errors are first taken as larger than they are: the way to the mode is then smooth
ROUNDS = 8
MOST_STEPS = 80
LEAST_GAIN, ROUGH_GAIN = 1e-4, 1e-2  # gain of the log posterior at which a mode is found, and nearly found
SHARES = (0.3, 0.05, 0.8)  # first positions, in parts of the largest, from which the mode is looked for
STEP, LEAPS = 0.2, 20  # first Hamiltonian step in units of the posterior's own scales, and most steps per draw
WARM_UP = 40
ACCEPT = 0.8  # acceptance at which each chain's step is aimed during the warm-up


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
    found = []
    for share in SHARES:
        theta = trilaterate(model, knobs, np.full(len(model.ranges), share))
        for loosen in LOOSEN:
            mode = _climb(model, theta, knobs, loosen, ROUGH_GAIN)
            theta = mode.theta
        found.append(mode)
    best = max(found, key=lambda m: m.value)
    return _climb(model, best.theta, knobs)


def descend(model: LossModel, knobs: list[Knobs]) -> list[Mode]:
    """The modes at settings that allow for ever smaller errors, each started from the one before."""
    found: list[list[Mode]] = []
    for share in SHARES:
        theta = trilaterate(model, knobs[0], np.full(len(model.ranges), share))
        path: list[Mode] = []
        for k in knobs:
            path.append(_climb(model, _restart(path[-1], k) if path else theta, k, least=ROUGH_GAIN))
        found.append(path)
    return [max(at, key=lambda m: m.value) for at in zip(*found, strict=True)]


def trilaterate(model: LossModel, knobs: Knobs, share: Array) -> Array:
    """Unknowns (P,) near the mode, from equations that are linear in the measured forces y,

        L_k^2 = |y|^2 - 2 F_k . y + |F_k|^2,

    with |y|^2 as an unknown of its own, y linearised about the smooth curve, and rows weighted down that do not fit.
    """
    nb, count = 2 + MODES, len(model.ranges)
    x, _, _, _ = model.positions(logit(share)[None])
    force, reference = model.simulations.forces(x)[0][0], model.simulations.reference_force(x)[0][0]
    basis = wiener_basis(float(max(model.simulations.ends)))(x[0])
    basis[:, 2:] *= np.ravel(knobs.roughness)[0]
    usable = force[:, model.use & model.simulations.usable]
    c = np.linalg.solve(
        basis.T @ basis / 0.02**2 + np.eye(nb), basis.T @ np.median(np.log(usable / reference[:, None]), 1) / 0.02**2
    )
    scale = model.error_scale(knobs, 1).reshape(count, -1) * LOOSEN[1]
    weight = np.tile(model.use.astype(float), (count, 1))
    for _ in range(ROUNDS):
        y = reference * np.exp(basis @ c)
        a = np.zeros((count, force.shape[1], nb + count))
        b = np.empty((count, force.shape[1]))
        for i, block in enumerate(model.blocks()):
            loss = model.losses[model.ranges[i]]
            part, moved = force[block].T, y[block, None] * basis[block]
            a[i, :, :nb], a[i, :, nb + i] = -2 * part @ moved, 1.0
            b[i] = loss**2 - np.sum(part**2, 1) + 2 * part @ (y[block] - moved @ c)
            a[i] /= 2 * (loss * scale[i])[:, None]
            b[i] /= 2 * loss * scale[i]
        new = _robust_lines(a.reshape(-1, nb + count), b.ravel(), weight.ravel(), nb, model.tail)[:nb]
        step = basis @ (new - c)
        c = c + min(1.0, 0.5 / max(float(np.max(np.abs(step))), 1e-12)) * (new - c)
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


def _climb(model: LossModel, theta: Array, knobs: Knobs, loosen: float = 1.0, least: float = LEAST_GAIN) -> Mode:
    """Damped Gauss-Newton from ``theta``; every step raises the posterior density, or it is the last."""
    here = _look(model, theta, knobs, loosen)
    damping = 1e-3
    for _ in range(MOST_STEPS):
        gain = 0.0
        for _ in range(15):
            step = np.linalg.solve(here.precision + damping * np.diag(np.diag(here.precision)), here.gradient)
            step = step / max(1.0, float(np.max(np.abs(step[-len(model.ranges) :]))))
            there = _look(model, here.theta + step, knobs, loosen)
            gain = there.value - here.value
            if gain > 0:
                break
            damping = max(damping, 1e-7) * 5
        if gain <= 0:
            break
        here, damping = there, max(damping / 10, 1e-10)
        if gain < least:
            break
    spread = 0.5 * theta.size * np.log(2 * np.pi) - 0.5 * float(np.linalg.slogdet(here.precision)[1])
    return Mode(here.theta, here.value, here.precision, here.value + spread, knobs)


class _Look(NamedTuple):
    """Unknowns, log posterior (-inf where there is none), its gradient, and its negative curvature."""

    theta: Array
    value: float
    gradient: Array
    precision: Array


def _look(model: LossModel, theta: Array, knobs: Knobs, loosen: float) -> _Look:
    with np.errstate(all="ignore"):
        state = model.evaluate(theta[None], knobs)
        values, gradients = model.log_density(theta[None], state, knobs, loosen)
    value, gradient = float(values[0]), gradients[0]
    if not (np.isfinite(value) and np.all(np.isfinite(gradient))):
        return _Look(theta, -np.inf, gradient, np.eye(theta.size))
    scale = model.error_scale(knobs, 1)[0] * loosen
    weight = model.weights(state.residual / scale)[0][0] / scale**2
    share = expit(theta[-len(model.ranges) :])
    prior = np.concatenate([np.ones(theta.size - share.size), 2 * share * (1 - share)])
    precision = (state.jacobian[0].T * weight) @ state.jacobian[0] + np.diag(prior)
    return _Look(theta, value, gradient, precision)


# ---- scales that are not known beforehand ----------------------------------------------------------------------------


def scan(model: LossModel, grid: list[Knobs], start: Mode) -> list[Mode]:
    """The modes at all settings of the scales, each from ``start``."""
    return [_climb(model, _restart(start, knobs), knobs) for knobs in grid]


def again(model: LossModel, mode: Mode, knobs: Knobs | None = None) -> Mode:
    """The mode of a model that differs a little from the one that ``mode`` belongs to, or at other scales."""
    knobs = mode.knobs if knobs is None else knobs
    return _climb(model, _restart(mode, knobs), knobs)


def _restart(mode: Mode, knobs: Knobs) -> Array:
    """The unknowns of a mode in the units of other scales, so that the smooth curve stays where it is."""
    theta = mode.theta.copy()
    theta[2 : 2 + MODES] *= np.ravel(mode.knobs.roughness)[0] / np.ravel(knobs.roughness)[0]
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


# ---- draws -----------------------------------------------------------------------------------------------------------


class Draws(NamedTuple):
    """Draws from the posterior, the scales included.

    Attributes
    ----------
    theta : (M, B, P) unknowns of B chains, each with its own scales
    knobs : scales of the chains
    acceptance : mean acceptance
    """

    theta: Array
    knobs: Knobs
    acceptance: float

    def states(self, model: LossModel) -> list[CurveState]:
        """What the draws mean, one `CurveState` of B vectors per step of the chains."""
        return [model.evaluate(t, self.knobs) for t in self.theta]


def sample(model: LossModel, modes: list[Mode], chains: int, steps: int, seed: int) -> Draws:
    """Hamiltonian draws: each chain has the scales of one mode, chosen in proportion to the evidences.

    The chain moves in the coordinates in which that mode's curvature is the identity. Raises `DataError` if hardly
    any step is accepted: the posterior is then not what its mode says.
    """
    rng = np.random.default_rng(seed)
    evidence = np.array([m.evidence for m in modes])
    share = np.cumsum(np.exp(evidence - logsumexp(evidence)))
    chosen = np.searchsorted(share, (np.arange(chains) + rng.random()) / chains * share[-1])
    chosen = np.minimum(chosen, len(modes) - 1)
    knobs = Knobs(*(np.concatenate([np.asarray(modes[i].knobs[k]) for i in chosen]) for k in range(4)))
    roots = {i: np.linalg.inv(np.linalg.cholesky(modes[i].precision)).T for i in set(chosen.tolist())}
    root = np.array([roots[i] for i in chosen])
    theta = np.array([modes[i].theta for i in chosen])
    theta = theta + 0.3 * np.einsum("bpq,bq->bp", root, rng.standard_normal(theta.shape))
    kept, accepted = [], []
    at = _Chains(theta, *_safe(model, theta, knobs))
    size = np.full(chains, STEP)
    for step in range(WARM_UP + steps):
        at, chance = _leap(model, at, knobs, root, size, rng)
        if step < WARM_UP:
            size = size * np.exp(0.15 * (chance - ACCEPT))
        else:
            kept.append(at.theta)
            accepted.append(chance)
    if np.mean(accepted) < 0.2:
        raise DataError("the reconstruction's posterior could not be sampled", remedy="check the table of losses")
    return Draws(np.array(kept), knobs, float(np.mean(accepted)))


class _Chains(NamedTuple):
    """Unknowns (B, P) of all chains, log posterior (B,) and gradient (B, P)."""

    theta: Array
    value: Array
    gradient: Array


def _leap(
    model: LossModel, at: _Chains, knobs: Knobs, root: Array, size: Array, rng: np.random.Generator
) -> tuple[_Chains, Array]:
    """One Hamiltonian step of all chains, and the chances of acceptance (B,)."""
    theta, value, gradient = at
    start = rng.standard_normal(theta.shape)
    step = (size * (1 + 0.2 * rng.standard_normal(size.size)))[:, None]
    new, slope = theta, np.einsum("bp,bpq->bq", gradient, root)
    momentum = start + 0.5 * step * slope
    leaps = int(rng.integers(LEAPS // 2, LEAPS + 1))
    for leap in range(leaps):
        new = new + np.einsum("bpq,bq->bp", root, step * momentum)
        trial, new_gradient = _safe(model, new, knobs)
        slope = np.einsum("bp,bpq->bq", new_gradient, root)
        momentum = momentum + (step if leap < leaps - 1 else 0.5 * step) * slope
    gain = trial - value - 0.5 * np.sum(momentum**2 - start**2, axis=1)
    chance = np.exp(np.minimum(0.0, np.where(np.isfinite(gain), gain, -np.inf)))
    take = rng.random(chance.size) < chance
    return _Chains(
        np.where(take[:, None], new, theta),
        np.where(take, trial, value),
        np.where(take[:, None], new_gradient, gradient),
    ), chance


def _safe(model: LossModel, theta: Array, knobs: Knobs) -> tuple[Array, Array]:
    """Value and gradient, with -inf and 0 where a chain ran away."""
    with np.errstate(all="ignore"):
        value, gradient = model.log_posterior(theta, knobs)
    good = np.isfinite(value) & np.all(np.isfinite(gradient), axis=1)
    return np.where(good, value, -np.inf), np.where(good[:, None], gradient, 0.0)
