"""Where ensembles start: spread wider than the posterior, each elsewhere, and none at an impossible point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.calibration.descent import Patience, descend
from bayesmembrane.calibration.objective import Objective, separated
from bayesmembrane.calibration.posterior import Evaluates, Evaluation, Marginalised, Outcomes, Posterior, weighed
from bayesmembrane.calibration.sampling.convergence import effective_draws
from bayesmembrane.data.thinning import shortened
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.numbers import bisected
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.forward import AT_ONCE

BROAD, CLOSE, ROUNDS, EACH = 256, 256, 5, 192
HALVINGS = 40  # of the interval of tempering powers
VALLEYS, ITERATIONS, TURNS = 8, 40, 8
ROUGH = Patience(behind=10.0, crawls_below=2e-2, slow_below=1e-2)
"""Draws this wide do not ask for an optimum: a descent is done where its last steps won a hundredth of |r|^2 each, and
one far behind the best where they won a fiftieth: what is 40 behind is not drawn around."""
WIDER = 1.5  # of the Laplace approximation
DEGREES = 4.0  # of freedom of the t-distribution around a valley
SPARE = 1.5  # effective number of candidates for each walker
SCREENED_BY = 500  # readings, which is enough to see where to begin
FINEST = 1e-11  # of the largest force: no noise that is inferred is below, as its bounds say


@dataclass(frozen=True, eq=False)
class Tried:
    """Points x (M, k) that were solved, and ``log_posterior`` there (M,), -inf where they are not possible.

    curves : (M, N) those of an `Evaluation`; None if they are too many numbers to be kept
    """

    x: Array
    log_posterior: Array
    curves: Array | None = None

    @classmethod
    def of(cls, posterior: Evaluates, x: Array, counts: Outcomes) -> Tried:
        """The points x (M, k), solved and counted."""
        few = len(x) * posterior.readings <= AT_ONCE
        found = posterior.evaluate(x) if few else weighed(posterior, x)
        counts.note(posterior.whole(x) if isinstance(posterior, Marginalised) else x, found.outcome)
        curves = found.curves if few and isinstance(found, Evaluation) else None
        return cls(x, found.log_posterior, curves)

    def joined(self, more: Tried) -> Tried:
        """These and further ones."""
        x, lp = np.concatenate([self.x, more.x]), np.concatenate([self.log_posterior, more.log_posterior])
        if self.curves is None or more.curves is None:
            return Tried(x, lp)
        return Tried(x, lp, np.concatenate([self.curves, more.curves]))

    def starts(self, rng: np.random.Generator, ensembles: int, walkers: int) -> Array:
        """Starting points (E, W, k), all possible and all different, drawn without replacement from p(x | y)^b.

        b <= 1 is the largest power at which the points are worth more than the walkers, so that the starts are spread
        at least as widely as the posterior.
        """
        found, wanted = self.possible, ensembles * walkers
        chosen = tempered(found.log_posterior, SPARE * wanted, wanted, rng)
        return np.asarray(found.x[rng.permutation(chosen)].reshape(ensembles, walkers, -1))

    @property
    def possible(self) -> Tried:
        """Those that are possible."""
        return self.those(np.isfinite(self.log_posterior))

    def those(self, some: NDArray[Any]) -> Tried:
        """Some of them."""
        return Tried(self.x[some], self.log_posterior[some], None if self.curves is None else self.curves[some])


def starting_points(
    posterior: Posterior,
    rng: np.random.Generator,
    ensembles: int,
    walkers: int,
    counts: Outcomes,
    first: Array | None = None,
) -> Array:
    """`Tried.starts` (E, W, k) of what `try_points` found; raises `SettingsError` as that does."""
    return try_points(posterior, rng, ensembles * walkers, counts, first).starts(rng, ensembles, walkers)


def try_points(
    posterior: Posterior, rng: np.random.Generator, wanted: int, counts: Outcomes, first: Array | None = None
) -> Tried:
    """Points around the valleys of the posterior, at least ``wanted`` of them possible.

    They are the `candidates`, or the ``first`` (M, k) if those are known, and what differential evolution makes of the
    better ones, in as many rounds as very many walkers need.

    Raises `SettingsError` if next to no admissible parameters reach the data.
    """
    tried = Tried.of(posterior, candidates(posterior, rng) if first is None else first, counts)
    for _ in range(max(ROUNDS, int(np.ceil((SPARE * wanted - len(tried.x)) / EACH)))):
        good = tried.possible
        if len(good.x) < 4:
            more = posterior.prior.draw(rng, 2 * EACH)
        else:
            parents = good.x[tempered(good.log_posterior, EACH / 2, EACH, rng)]
            more = evolved(parents, rng)
        tried = tried.joined(Tried.of(posterior, more, counts))
    if len(tried.possible.x) < wanted:
        mode = posterior.hypothesis.convexity
        limit = "" if not mode.restricts else f' that meet the convexity prior "{mode}"'
        raise SettingsError(
            f"next to no {posterior.hypothesis.label()} films{limit} reach "
            f"{1e3 * np.max(posterior.measurement.deflection):g} mm",
            remedy="use a shorter range, another material or another convexity prior",
        )
    return tried


def candidates(posterior: Posterior, rng: np.random.Generator) -> Array:
    """(M, k): prior draws brought to their best modulus, and draws around the valleys that a descent finds from them,
    with noise coordinates that suit their residuals. Convexity is not asked for.
    """
    few = shortened(posterior.measurement, SCREENED_BY)
    objective = Objective(posterior.hypothesis, few, "euclidean", posterior.solve)
    pool, size = objective.pool(rng)
    each = len(posterior.measurement) / len(few)
    close = _around_valleys(objective, pool, size[0] / np.sqrt(len(few)), each, rng)
    step = max(1, len(pool) // BROAD)
    curves = np.concatenate([pool[::step], close])
    x = posterior.prior.draw(rng, len(curves))
    k = posterior.hypothesis.curve_size
    x[:, :k] = curves
    if x.shape[1] > k:
        # Of films without effects the pool has solved the curves; effects are not in it.
        known = np.empty(0) if posterior.hypothesis.effects else size[::step]
        force = objective.forward(curves[len(known) :], reached=False).force
        rms = np.append(known / np.sqrt(len(few)), np.sqrt(np.mean((force - few.force) ** 2, axis=1)))
        fits = np.log(rms / posterior.hypothesis.noise.natural(np.zeros((1, x.shape[1] - k)), 1.0)[0, 0])
        fits -= np.log(np.max(np.abs(posterior.measurement.force)))
        some = np.isfinite(fits) & (rng.random(len(x)) < 0.7)
        x[some, k] = fits[some] + 0.5 * rng.standard_normal(int(np.sum(some)))
    return x


def _around_valleys(objective: Objective, pool: Array, rms: float, each: float, rng: np.random.Generator) -> Array:
    """Draws (CLOSE, k) from a wide t-distribution around the optima of likelihood times prior.

    A normal with the prior's median and spread stands for the prior; the noise is the residual of the best start,
    then of the best optimum, until that falls no more. Every reading stands for ``each``.
    """
    k, low, high = pool.shape[1], objective.low, objective.high
    pull = np.diag(1 / objective.spread)
    own = objective.measurement.force_sd
    floor = FINEST * np.max(np.abs(objective.measurement.force)) if own is None else float(np.sqrt(np.mean(own**2)))
    sigma, worth = max(rms, floor), np.sqrt(each)

    def residuals(x: Array) -> tuple[Array, Array]:
        r, j = objective.batch(x)
        wide = np.broadcast_to(pull, (len(x), k, k))
        return (
            np.concatenate([r * (worth / sigma), (x - objective.centre) / objective.spread], axis=1),
            np.concatenate([j * (worth / sigma), wide], axis=1),
        )

    x = np.array(separated(pool, objective.spread, VALLEYS))
    for turn in range(TURNS):
        x, size = descend(residuals, x, (low, high), ITERATIONS, patience=ROUGH)
        best, before = x[int(np.argmin(size))], sigma
        sigma = max(float(np.sqrt(np.mean(objective(best)[0] ** 2))), floor)
        # With too large a noise the prior keeps the optimum off the data: of fine ones it takes several turns.
        if turn and sigma > before / 2:
            break
    x, size = x[np.isfinite(size)], size[np.isfinite(size)]
    likely = size**2 < np.min(size**2, initial=np.inf) + 40.0
    _, jacobian = residuals(x[likely])
    which = rng.integers(np.count_nonzero(likely), size=CLOSE)
    root = spread_of(jacobian)
    z = rng.standard_normal((CLOSE, k)) * np.sqrt(DEGREES / rng.chisquare(DEGREES, (CLOSE, 1)))
    return np.asarray(np.clip(x[likely][which] + WIDER * np.einsum("mkl,ml->mk", root[which], z), low, high))


def spread_of(jacobian: Array) -> Array:
    """(M, k, k) lower triangular L with L L^T = (J^T J)^-1, of J (M, n, k): by QR, for J^T J has half of its digits.

    J P = Q R with P that turns the order round: L = P R^-1 P, its columns turned so that the diagonal is positive.
    """
    inverse = np.linalg.inv(np.linalg.qr(jacobian[..., ::-1], mode="r"))[..., ::-1, ::-1]
    return np.asarray(inverse * np.sign(np.diagonal(inverse, axis1=1, axis2=2))[:, None, :])


def tempered(lp: Array, worth: float, count: int, rng: np.random.Generator) -> Array:
    """Indices (count,) of candidates drawn with weights exp(b lp), without replacement while they last; b <= 1 is the
    largest at which they are worth ``worth`` draws.
    """
    lp = lp - np.max(lp)
    worth = min(worth, 0.9 * len(lp))
    power, _ = bisected(lambda b: effective_draws(np.exp(b * lp)) >= worth, 0.0, 1.0, HALVINGS)
    # The largest of ln w + Gumbel noise are a draw without replacement.
    order = np.argsort(-(power * lp + rng.gumbel(size=lp.size)))
    return np.asarray(np.resize(order, count) if len(order) < count else order[:count])


def evolved(parents: Array, rng: np.random.Generator) -> Array:
    """(n, k) x_i + g (x_a - x_b), with g about half of what is best for exploring a normal distribution."""
    n, k = parents.shape
    a, b = rng.integers(n, size=(2, n))
    g = 1.2 / np.sqrt(2 * k) * np.exp(0.3 * rng.standard_normal((n, 1)))
    jitter = 1e-3 * np.std(parents, axis=0) * rng.standard_normal((n, k))
    return np.asarray(parents + g * (parents[a] - parents[b]) + jitter)
