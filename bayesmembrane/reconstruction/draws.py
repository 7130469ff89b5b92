"""Draws from the posterior of a curve and its evidence: particles that move from the modes' Gaussians to the posterior.

Curves that meet the losses lie on a sphere, so where the losses leave much open the posterior is a cap and not the
Gaussian of its mode: Laplace's evidence is then too large, by several units where a family of curves is wide. Particles
drawn from the Gaussians q, one for each setting of the scales, therefore go through q^(1-b) p^b, b from 0 to 1, in
steps that leave `KEPT` of them effective; each is weighed, drawn anew and moved by Hamiltonian steps (P. Del Moral,
A. Doucet, A. Jasra, J. R. Stat. Soc. B 68 (2006) 411). The weights give the evidence of all settings together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.reconstruction.fit import Mode, together
from bayesmembrane.reconstruction.model import CurveState, Knobs, LossModel

KEPT = 0.6  # share of the particles that stays effective on the way from one b to the next
MOVES, STAGES = 2, 200  # Hamiltonian steps at each b, and most values of b
STEP, LEAPS = 0.2, 20  # first Hamiltonian step in units of the modes' own scales, and most steps per move
ACCEPT = 0.8  # acceptance at which each particle's step is aimed on the way
LEAST = 0.2  # acceptance below which nothing is said


class Draws(NamedTuple):
    """Draws from the posterior, the scales included.

    Attributes
    ----------
    theta : (M, B, P) unknowns of B chains, each with its own scales
    knobs : scales of the chains
    acceptance : mean acceptance
    log_evidence, log_evidence_sd : ln of the sum of p(losses) over the settings, and its statistical error
    """

    theta: Array
    knobs: Knobs
    acceptance: float
    log_evidence: float
    log_evidence_sd: float

    def states(self, model: LossModel) -> list[CurveState]:
        """What the draws mean, one `CurveState` of B vectors per step of the chains."""
        return [model.evaluate(t, self.knobs) for t in self.theta]


def sample(model: LossModel, modes: Sequence[Mode], chains: int, steps: int, seed: int) -> Draws:
    """``steps`` draws of each of ``chains`` particles that have come all the way from the modes.

    Raises `DataError` if hardly any move is accepted, or the way is too long: the posterior is then not what its modes
    say.
    """
    rng = np.random.default_rng(seed)
    at, bridge = _start(model, modes, chains, rng)
    log_evidence, variance, b = 0.0, 0.0, 0.0
    for _ in range(STAGES):
        gain = np.where(np.isfinite(at.value), at.value - at.start, -1e12)
        step = _stride(gain, 1.0 - b)
        weight = step * gain
        share = np.exp(weight - logsumexp(weight))
        log_evidence += float(logsumexp(weight) - np.log(chains))
        variance += float(np.sum(share**2) - 1 / chains)
        b += step
        kept = np.searchsorted(np.cumsum(share), (np.arange(chains) + rng.random()) / chains * (1 - 1e-12))
        at, bridge = at.take(kept), bridge.take(kept)
        for _ in range(MOVES):
            at, chance = _move(bridge, at, b, rng)
            bridge = bridge.aimed(chance)
        if b >= 1.0:
            break
    if b < 1.0:
        raise _lost()
    kept_draws, accepted = [], []
    for _ in range(steps):
        at, chance = _move(bridge, at, 1.0, rng)
        kept_draws.append(bridge.unknowns(at.v))
        accepted.append(chance)
    if np.mean(accepted) < LEAST:
        raise _lost()
    return Draws(np.array(kept_draws), bridge.knobs, float(np.mean(accepted)), log_evidence, float(np.sqrt(variance)))


def _lost() -> DataError:
    return DataError("the reconstruction's posterior could not be sampled", remedy="check the table of losses")


def _stride(gain: Array, most: float) -> float:
    """The largest step in b, up to ``most``, that leaves `KEPT` of the particles effective."""

    def effective(step: float) -> float:
        w = step * gain
        return float(np.exp(2 * logsumexp(w) - logsumexp(2 * w))) / gain.size

    if effective(most) >= KEPT:
        return most
    low, high = 0.0, most
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if effective(middle) >= KEPT else (low, middle)
    return max(low, 1e-12)


class _Particles(NamedTuple):
    """Places v (B, P) in the coordinates of the modes; ln p (B,), its gradient in v (B, P), and ln q (B,)."""

    v: Array
    value: Array
    gradient: Array
    start: Array

    def take(self, index: NDArray[np.intp]) -> _Particles:
        return _Particles(*(a[index] for a in self))


@dataclass(frozen=True)
class _Bridge:
    """Each particle's mode (B, P), root of its covariance (B, P, P), ln q at the mode (B,), scales, and step size."""

    model: LossModel
    centre: Array
    root: Array
    top: Array
    knobs: Knobs
    size: Array

    def take(self, index: NDArray[np.intp]) -> _Bridge:
        parts = (a[index] for a in (self.centre, self.root, self.top))
        return _Bridge(self.model, *parts, self.knobs.take(index), self.size[index])

    def aimed(self, chance: Array) -> _Bridge:
        """With steps that are longer where moves were accepted."""
        size = self.size * np.exp(0.3 * (chance - ACCEPT))
        return _Bridge(self.model, self.centre, self.root, self.top, self.knobs, size)

    def unknowns(self, v: Array) -> Array:
        return np.asarray(self.centre + np.einsum("bpq,bq->bp", self.root, v))

    def look(self, v: Array) -> _Particles:
        """With -inf and 0 where a particle ran away."""
        with np.errstate(all="ignore"):
            value, gradient = self.model.log_posterior(self.unknowns(v), self.knobs)
        good = np.isfinite(value) & np.all(np.isfinite(gradient), axis=1)
        slope = np.einsum("bp,bpq->bq", np.where(good[:, None], gradient, 0.0), self.root)
        return _Particles(v, np.where(good, value, -np.inf), slope, self.top - 0.5 * np.sum(v**2, axis=1))


def _start(
    model: LossModel, modes: Sequence[Mode], chains: int, rng: np.random.Generator
) -> tuple[_Particles, _Bridge]:
    """Particles from the modes' Gaussians, from each mode in proportion to its evidence."""
    evidence = np.array([m.evidence for m in modes])
    log_share = evidence - logsumexp(evidence)
    chosen = np.searchsorted(np.cumsum(np.exp(log_share)), (np.arange(chains) + rng.random()) / chains * (1 - 1e-12))
    roots = {i: np.linalg.inv(np.linalg.cholesky(modes[i].precision)).T for i in set(chosen.tolist())}
    normal = -0.5 * modes[0].theta.size * np.log(2 * np.pi)
    tops = {i: log_share[i] + normal + 0.5 * np.linalg.slogdet(modes[i].precision)[1] for i in roots}
    bridge = _Bridge(
        model,
        np.array([modes[i].theta for i in chosen]),
        np.array([roots[i] for i in chosen]),
        np.array([tops[i] for i in chosen]),
        together([modes[i].knobs for i in chosen]),
        np.full(chains, STEP),
    )
    return bridge.look(rng.standard_normal(bridge.centre.shape)), bridge


def _move(bridge: _Bridge, at: _Particles, b: float, rng: np.random.Generator) -> tuple[_Particles, Array]:
    """One Hamiltonian step of all particles at q^(1-b) p^b, and the chances of acceptance (B,)."""
    start = rng.standard_normal(at.v.shape)
    step = (bridge.size * (1 + 0.2 * rng.standard_normal(bridge.size.size)))[:, None]
    momentum, new = start + 0.5 * step * _slope(at, b), at
    leaps = int(rng.integers(LEAPS // 2, LEAPS + 1))
    for leap in range(leaps):
        new = bridge.look(new.v + step * momentum)
        momentum = momentum + (step if leap < leaps - 1 else 0.5 * step) * _slope(new, b)
    gain = _level(new, b) - _level(at, b) - 0.5 * np.sum(momentum**2 - start**2, axis=1)
    chance = np.exp(np.minimum(0.0, np.where(np.isfinite(gain), gain, -np.inf)))
    take = rng.random(chance.size) < chance
    mixed = (np.where(take[:, None] if a.ndim == 2 else take, a, o) for a, o in zip(new, at, strict=True))
    return _Particles(*mixed), chance


def _level(at: _Particles, b: float) -> Array:
    return (1 - b) * at.start + b * at.value


def _slope(at: _Particles, b: float) -> Array:
    return b * at.gradient - (1 - b) * at.v
