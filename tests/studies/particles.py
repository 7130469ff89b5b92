"""Draws from the posterior of a curve and its evidence: particles that follow the errors down to their size.

Curves that meet the losses lie on a sphere, so where the losses leave much open the posterior is a cap and not the
Gaussian of its mode, and Laplace's evidence is off by several units. With errors `LOOSEN` times as large it is nearly
that Gaussian. Particles drawn there, one scale of the errors each, follow as the errors shrink to their size, in steps
that leave `KEPT` of them effective; at each they are weighed, drawn anew and moved by Hamiltonian steps (P. Del Moral,
A. Doucet, A. Jasra, J. R. Stat. Soc. B 68 (2006) 411). The weights give the evidence of all settings together.

    python -m tests.studies.particles [--seeds 1 2] [--particles 64]

prints, for each family of curves behind the paper's losses, Laplace's evidence beside that of the particles.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from bayesmembrane.data.published import read_published_table
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.reconstruction.families.smooth_logarithm import SmoothLogarithm
from bayesmembrane.reconstruction.fit import ROUGH_GAIN, Mode, climb, curvature, together
from bayesmembrane.reconstruction.mixture import moved
from bayesmembrane.reconstruction.model import CurveState, Knobs, LossModel
from bayesmembrane.reconstruction.reconstruct import curve_of_all_families, simulate_on
from bayesmembrane.reconstruction.scales import all_scales
from bayesmembrane.reconstruction.simulations import tabulate

LOOSEN = 64.0
KEPT = 0.5  # share of the particles that stays effective on the way from one stage to the next
MOVES, STAGES = 2, 200  # Hamiltonian steps at each stage, and most stages
STEP, LEAPS = 0.3, 16  # first Hamiltonian step in units of the posterior's own scales, and most steps per move
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
    crowd, path, tally = _start(model, modes, chains, rng), _Path(0.0, LOOSEN), _Tally()
    for _ in range(STAGES):
        crowd, path = tally.weigh(crowd, path, rng)
        crowd = crowd.measured(path)
        for _ in range(MOVES):
            crowd, chance = _move(crowd, path, rng)
            crowd = crowd.aimed(chance)
        if path.loosen == 1.0:
            break
    else:
        raise _lost()
    kept, accepted = [], []
    for _ in range(steps):
        crowd, chance = _move(crowd, path, rng)
        kept.append(crowd.theta)
        accepted.append(chance)
    if np.mean(accepted) < LEAST:
        raise _lost()
    return Draws(np.array(kept), crowd.knobs, float(np.mean(accepted)), tally.total, float(np.sqrt(tally.variance)))


def _lost() -> DataError:
    return DataError("the reconstruction's posterior could not be sampled", remedy="check the table of losses")


@dataclass(frozen=True)
class _Path:
    """Where the particles are: q^(1-b) p^b, q the Gaussians and p the posterior with errors ``loosen`` times as large.

    First b goes from 0 to 1, then the errors shrink.
    """

    b: float
    loosen: float

    @property
    def left(self) -> float:
        """Length of the part of the way that is walked now."""
        return 1.0 - self.b if self.b < 1.0 else float(np.log(self.loosen))

    def after(self, step: float) -> _Path:
        """The place ``step`` further; a step as long as what is left leads to its end."""
        end = step >= self.left - 1e-9
        if self.b < 1.0:
            return _Path(1.0 if end else self.b + step, self.loosen)
        return _Path(1.0, 1.0 if end else self.loosen * float(np.exp(-step)))


class _Gaussian(NamedTuple):
    """The Gaussian that each particle started from: centre (B, P), precision (B, P, P), ln density there (B,)."""

    centre: Array
    precision: Array
    top: Array


@dataclass(frozen=True)
class _Crowd:
    """Particles: unknowns (B, P), what they mean, scales, roots (B, P, P) of the metrics, step sizes, mode of each."""

    model: LossModel
    theta: Array
    state: CurveState
    knobs: Knobs
    start: _Gaussian
    root: Array
    size: Array
    group: NDArray[np.intp]

    def take(self, index: NDArray[np.intp]) -> _Crowd:
        """Those at ``index``."""
        state, start = CurveState(*(v[index] for v in self.state)), _Gaussian(*(v[index] for v in self.start))
        parts = self.root[index], self.size[index], self.group[index]
        return _Crowd(self.model, self.theta[index], state, self.knobs.take(index), start, *parts)

    def value(self, path: _Path) -> Array:
        """(B,) ln of the density that they are at, -inf where a particle ran away."""
        with np.errstate(all="ignore"):
            value = self.model.log_prior(self.theta)[0]
            value = value + self.model.log_likelihood(self.state.residual, self.knobs, path.loosen)
            value = path.b * np.where(np.isfinite(value), value, -1e9)
            if path.b < 1.0:
                off = self.theta - self.start.centre
                gauss = self.start.top - 0.5 * np.einsum("bp,bpq,bq->b", off, self.start.precision, off)
                value = value + (1 - path.b) * gauss
        return np.asarray(np.where(np.isfinite(value), value, -1e9))

    def slope(self, path: _Path) -> Array:
        """(B, P) its gradient in the coordinates of the metric, 0 where a particle ran away."""
        with np.errstate(all="ignore"):
            gradient = path.b * self.model.log_density(self.theta, self.state, self.knobs, path.loosen)[1]
            if path.b < 1.0:
                off = self.theta - self.start.centre
                gradient = gradient - (1 - path.b) * np.einsum("bpq,bq->bp", self.start.precision, off)
        gradient = np.where(np.all(np.isfinite(gradient), axis=1)[:, None], gradient, 0.0)
        return np.einsum("bp,bpq->bq", gradient, self.root)

    def moved(self, step: Array) -> _Crowd:
        """A step (B, P) in the coordinates of the metric further."""
        theta = self.theta + np.einsum("bpq,bq->bp", self.root, step)
        with np.errstate(all="ignore"):
            state = self.model.evaluate(theta, self.knobs)
        return replace(self, theta=theta, state=state)

    def aimed(self, chance: Array) -> _Crowd:
        """With steps that are longer where moves were accepted."""
        return replace(self, size=np.clip(self.size * np.exp(0.4 * (chance - ACCEPT)), 1e-3, 1.0))

    def measured(self, path: _Path) -> _Crowd:
        """With the mean curvature of the particles that share their scales as metric."""
        if path.b < 1.0:
            return self
        precision = curvature(self.model, self.theta, self.state, self.knobs, path.loosen)
        root = np.empty_like(precision)
        for g in np.unique(self.group):
            mine = self.group == g
            root[mine] = np.linalg.inv(np.linalg.cholesky(np.mean(precision[mine], axis=0))).T
        return replace(self, root=root)


class _Tally:
    """The evidence so far, ln, and the variance of its error."""

    def __init__(self) -> None:
        self.total, self.variance = 0.0, 0.0

    def weigh(self, crowd: _Crowd, path: _Path, rng: np.random.Generator) -> tuple[_Crowd, _Path]:
        """Draw the particles anew at the farthest place that leaves `KEPT` of them effective."""
        now, count = crowd.value(path), len(crowd.theta)

        def gain(step: float) -> Array:
            return crowd.value(path.after(step)) - now

        step = _stride(gain, path.left)
        weight = gain(step)
        share = np.exp(weight - logsumexp(weight))
        self.total += float(logsumexp(weight) - np.log(count))
        self.variance += float(np.sum(share**2) - 1 / count)
        kept = np.searchsorted(np.cumsum(share), (np.arange(count) + rng.random()) / count * (1 - 1e-12))
        return crowd.take(kept), path.after(step)


def _stride(gain: Callable[[float], Array], most: float) -> float:
    def effective(step: float) -> float:
        w = gain(step)
        return float(np.exp(2 * logsumexp(w) - logsumexp(2 * w))) / w.size

    if effective(most) >= KEPT:
        return most
    low, high = 0.0, most
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if effective(middle) >= KEPT else (low, middle)
    return max(low, 1e-6)


def _start(model: LossModel, modes: Sequence[Mode], chains: int, rng: np.random.Generator) -> _Crowd:
    """Particles from the Gaussians of the modes with large errors.

    The settings are chosen in proportion to their evidence with errors of their size, where it is them that count.
    """
    evidence = np.array([m.evidence for m in modes])
    log_share = evidence - logsumexp(evidence)
    chosen = np.searchsorted(np.cumsum(np.exp(log_share)), (np.arange(chains) + rng.random()) / chains * (1 - 1e-12))
    index = np.unique(chosen)
    loose = climb(
        model,
        np.array([modes[i].theta for i in index]),
        together([modes[i].knobs for i in index]),
        LOOSEN,
        ROUGH_GAIN,
    )
    group = np.searchsorted(index, chosen)
    precision = np.array([m.precision for m in loose])
    roots = np.array([np.linalg.inv(np.linalg.cholesky(p)).T for p in precision])
    tops = 0.5 * np.linalg.slogdet(precision)[1] + log_share[index] - 0.5 * precision.shape[1] * np.log(2 * np.pi)
    centre = np.array([m.theta for m in loose])[group]
    theta = centre + np.einsum("bpq,bq->bp", roots[group], rng.standard_normal(centre.shape))
    knobs = together([modes[i].knobs for i in chosen])
    with np.errstate(all="ignore"):
        state = model.evaluate(theta, knobs)
    start = _Gaussian(centre, precision[group], tops[group])
    return _Crowd(model, theta, state, knobs, start, roots[group], np.full(chains, STEP), group)


def _move(crowd: _Crowd, path: _Path, rng: np.random.Generator) -> tuple[_Crowd, Array]:
    """One Hamiltonian step of all particles, and the chances of acceptance (B,)."""
    start = rng.standard_normal(crowd.theta.shape)
    step = (crowd.size * (1 + 0.2 * rng.standard_normal(crowd.size.size)))[:, None]
    momentum, new = start + 0.5 * step * crowd.slope(path), crowd
    leaps = int(rng.integers(LEAPS // 2, LEAPS + 1))
    for leap in range(leaps):
        new = new.moved(step * momentum)
        momentum = momentum + (step if leap < leaps - 1 else 0.5 * step) * new.slope(path)
    gain = new.value(path) - crowd.value(path) - 0.5 * np.sum(momentum**2 - start**2, axis=1)
    chance = np.exp(np.minimum(0.0, np.where(np.isfinite(gain), gain, -np.inf)))
    take = rng.random(chance.size) < chance
    state = CurveState(*(_chosen(take, a, o) for a, o in zip(new.state, crowd.state, strict=True)))
    return replace(crowd, theta=_chosen(take, new.theta, crowd.theta), state=state), chance


def _chosen(take: NDArray[np.bool_], new: Array, old: Array) -> Array:
    return np.where(take.reshape(-1, *(1,) * (new.ndim - 1)), new, old)


def main() -> None:
    """Both estimates of the evidence of every family, and the force at 4.8 mm that particles find."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--particles", type=int, default=64)
    asked = parser.parse_args()
    table = read_published_table()
    simulate = simulate_on(table)
    simulations = tabulate(table, simulate)
    curve = SmoothLogarithm(simulations)
    model = LossModel(simulations, curve, table.losses, simulations.usable, (0, 1), (10, 9), table.step).without(3)
    mixed = curve_of_all_families(model, table, simulate)
    for k in mixed.told:
        placed = mixed.placed[k]
        settings = len(all_scales(placed.family, 2))
        for seed in asked.seeds:
            draws = sample(placed.model, placed.modes, asked.particles, 30, seed)
            forces = np.concatenate(
                [
                    moved(placed.model, theta, draws.knobs, state, mixed.x)
                    for theta, state in zip(draws.theta, draws.states(placed.model), strict=True)
                ]
            )
            print(
                f"{placed.family.name}: Laplace {placed.log_evidence:.1f}, particles "
                f"{draws.log_evidence - np.log(settings):.1f} +- {draws.log_evidence_sd:.1f}, at 4.8 mm "
                f"{1e3 * np.mean(forces[:, 1]):.0f} +- {1e3 * np.std(forces[:, 1]):.0f} mN",
                flush=True,
            )


if __name__ == "__main__":
    main()
