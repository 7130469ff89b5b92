"""ln Z by nested sampling: dynesty's bookkeeping and bounds, with proposals that are evaluated in batches."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from dynesty import NestedSampler
from dynesty.bounding import UnitCube
from dynesty.internal_samplers import InternalSampler, SamplerReturn, tune_slice
from scipy.special import logsumexp

from bayesmembrane.comparison.evidence.closer import Closer
from bayesmembrane.comparison.evidence.layers import log_integral
from bayesmembrane.comparison.evidence.search import search
from bayesmembrane.comparison.evidence.target import EvidenceEstimate, Problem, Target
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array

PILOT_LIVE, PILOT_PER_DIMENSION = 150, 30
LEAST_LIVE, PER_DIMENSION, MOST_LIVE = 80, 15, 4000
TOLERANCE, LEAST_SD = 0.13, 1e-3
PILOTS, LEAST_RUNS, MOST_RUNS = 2, 3, 12  # of the least all count but pilots that missed a mode
REMAINING, NEAR = 0.2, 0.5  # ln Z that may be left in the live points when they are added: from the prior, and from q
QUEUE = 0.25  # of the live points are proposed at once: those that fall behind meanwhile are lost
SHRINK = 0.3  # of ln(volume) between two fits of the bounds
SLICES = 5  # for each dimension (W. J. Handley et al., MNRAS 453 (2015) 4384)
PER_SLICE = 5.5  # evaluations that a slice takes
PAUSE = 20  # batches of slices before rejection is tried again
LARGEST, SMALLEST = 512, 16  # batch
COPIES = 3  # draws from weighted points for each that they are worth
MOST_CUTS = 100  # of an interval, after which the start is kept: below that lies round-off

Tell = Callable[[str], None]


class Keep(Protocol):
    """What ``make`` returns, or what it returned when the piece of this name was made before."""

    def __call__(self, name: str, make: Callable[[], ARun], /) -> ARun: ...


def nested(
    target: Target,
    seed: int,
    tolerance: float = TOLERANCE,
    tell: Tell | None = None,
    around: Sequence[Array] | None = None,
    keep: Keep = lambda name, make: make(),
) -> EvidenceEstimate:
    """ln Z = ln of the integral of L dX over the prior volume X, by live points that climb the likelihood.

    Two independent runs climb from the prior. What they find makes a density q, broad and with heavy tails, from which
    the others climb L p0 / q: Z is the same, but the way is shorter, and the error smaller with it (X. Chen,
    M. P. Hobson, S. Das, P. Gelderblom, Stat. Comput. 29 (2019) 835). They hold as many live points as a standard error
    of ``tolerance`` takes; more runs follow while the scatter between all says that it was not enough. A run of N live
    points has an error of about sqrt(H / N) for information H; their mean weighs them by it, and its error is inflated
    by the root of chi^2 / (R - 1) of R runs where that is above 1.

    Where points (n, k) ``around`` all of the posterior are known, q is made of them, and nothing climbs from the prior:
    draws of it first, then places that draws may have missed.

    Half of q stands on the modes that a `search` from points that fill the prior finds, which knows nothing of the
    draws or of those that climb; a run from the prior whose ln Z is less than that of these modes has missed one, and
    does not count.

    Each run replaces its worst live point by one drawn from the prior above its likelihood: uniformly from ellipsoids
    around the live points (bounds enlarged by bootstrap) while that is efficient, by random slices otherwise.

    ln Z of a run and its error come from the layers between its likelihoods (`log_integral`).

    Each run has random numbers of its own, so that ``keep`` may bring those of an estimate that was killed: the rest is
    as it would have been.

    J. Skilling, Bayesian Anal. 1 (2006) 833; F. Feroz, M. P. Hobson, M. Bridges, MNRAS 398 (2009) 1601; J. S. Speagle,
    MNRAS 493 (2020) 3132. Raises `SettingsError` if prior and likelihood nowhere meet.
    """
    problem, own = Problem(target), np.random.default_rng([seed, 8])
    rngs = np.random.default_rng([seed, 5]).spawn(MOST_RUNS)
    modes = search(problem, np.random.default_rng([seed, 9]))
    besides, took = problem.evaluations, problem.seconds
    climbs = _Climbs(problem, rngs, keep)
    found: list[ARun] = []
    if around is None:
        from_prior = max(PILOT_LIVE, PILOT_PER_DIMENSION * problem.size)
        pilots = [climbs.run(i, problem, from_prior, REMAINING) for i in range(PILOTS)]
        around = [np.concatenate([r.drawn(own) for r in pilots])]
        # What has missed a mode on its way up says nothing of Z, and its part in q does no harm.
        found = [r for r in pilots if not modes.beyond(r.log_evidence, r.sd)]
    before, began = problem.evaluations, problem.seconds
    near = Closer(problem, around, modes, own)
    besides, took = besides + problem.evaluations - before, took + problem.seconds - began
    live = max(LEAST_LIVE, PER_DIMENSION * problem.size)
    for number in range(PILOTS, MOST_RUNS):
        if number > PILOTS:  # the first tells what it takes
            live = _needed(found, live, tolerance)
        found.append(climbs.run(number, near, live, NEAR))
        value, sd = _together(found)
        if tell is not None:
            tell(f"nested sampling, run {len(found)}: {value:.2f} +- {sd:.2f}")
        if len(found) >= LEAST_RUNS and sd <= tolerance:
            break
    # Weighed draws of the modes are an estimate of their own that is never too high: a gross difference is an error.
    sd = max(sd, 0.5 * modes.beyond(value, sd))
    parts = tuple(r.log_evidence for r in found)
    evaluations = besides + sum(r.evaluations for r in climbs.made)
    seconds = took + sum(r.seconds for r in climbs.made)
    return EvidenceEstimate(value, sd, evaluations, seconds, parts, modes.coverage)


@dataclass(frozen=True, eq=False)
class ARun:
    """ln Z of one run, its own error, its points x (M, k), their weights (M,) that add up to one, and what it cost."""

    log_evidence: float
    sd: float
    x: Array
    weight: Array
    evaluations: int = 0
    seconds: float = 0.0

    def drawn(self, rng: np.random.Generator) -> Array:
        """Points (n, k) of the posterior, each at most once: as many as the weights are worth, or a few times that."""
        count = int(COPIES / np.sum(self.weight**2))
        return np.asarray(self.x[np.unique(rng.choice(len(self.x), count, p=self.weight))])


@dataclass
class _Climbs:
    """The runs of an estimate, each kept as soon as it is there."""

    problem: Problem
    rngs: Sequence[np.random.Generator]
    keep: Keep
    made: list[ARun] = field(default_factory=list)

    def run(self, number: int, where: Problem, live: int, remaining: float) -> ARun:
        """Run ``number`` in ``where``, which asks ``problem`` for its likelihoods."""

        def make() -> ARun:
            before, began = self.problem.evaluations, time.perf_counter()
            run = _run(where, live, self.rngs[number], remaining)
            return replace(run, evaluations=self.problem.evaluations - before, seconds=time.perf_counter() - began)

        self.made.append(self.keep(f"run-{number}", make))
        return self.made[-1]


def _needed(found: list[ARun], live: int, tolerance: float) -> int:
    """Live points for one more run, so that the own errors of all together come down to ``tolerance``."""
    own = np.array([r.sd for r in found])
    missing = tolerance**-2 - np.sum(own**-2)
    return int(np.clip(live * missing * own[-1] ** 2, LEAST_LIVE, MOST_LIVE))


def _together(found: list[ARun]) -> tuple[float, float]:
    """(weighted mean, standard error) of runs."""
    z, own = np.array([(r.log_evidence, r.sd) for r in found]).T
    w = own**-2
    mean = float(w @ z / np.sum(w))
    scatter = float(w @ (z - mean) ** 2 / max(1, len(z) - 1))
    return mean, float(np.sqrt(max(1.0, scatter) / np.sum(w)))


def _run(problem: Problem, live: int, rng: np.random.Generator, remaining: float) -> ARun:
    """One run with ``live`` points, until at most ``remaining`` of ln Z is in them."""
    start = problem.prior_draws(rng, live)
    points = [start.u[:live], start.x[:live], start.log_likelihood[:live].copy()]
    if np.ptp(points[2]) == 0:
        # A likelihood that is constant where it is not zero has nothing to climb.
        value = float(points[2][0] + np.log(start.part))
        return ARun(value, start.log_part_sd, points[1], np.full(live, 1 / live))
    queue = max(8, int(QUEUE * live))
    with warnings.catch_warnings():
        # What dynesty warns of (inefficient ellipsoids, plateaus) is met by slices, and judged by the scatter.
        warnings.simplefilter("ignore")
        sampler = NestedSampler(
            _never,
            _never,
            problem.size,
            nlive=live,
            bound="multi",
            sample=_Batched(),
            bootstrap=5,
            live_points=points,
            rstate=rng,
            pool=_Proposals(problem, rng),
            queue_size=queue,
            use_pool={"prior_transform": False, "loglikelihood": False, "propose_point": True, "update_bound": False},
        )
        sampler.run_nested(dlogz=remaining, print_progress=False, save_bounds=False)
    r = sampler.results
    value, error = log_integral(np.asarray(r.logl), np.asarray(r.logvol[: len(r.logl) - live]), live)
    # Where only a part of q or of the prior counts, its share is known as well as this many draws tell.
    value += float(np.log(start.part))
    weight = np.exp(r.logwt - logsumexp(r.logwt))
    sd = max(float(np.hypot(error, start.log_part_sd)), LEAST_SD)
    return ARun(value, sd, np.asarray(r.samples), weight)


def _never(_: Array) -> Any:
    raise SettingsError("dynesty asked for a single likelihood, and all are evaluated in batches")


class _Batched(InternalSampler):  # type: ignore[misc]
    """Tells dynesty's bounds to the pool, which does the work."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.slice_history = {"n_contract": 0, "n_expand": 0}

    @property
    def update_bound_interval_ratio(self) -> float:
        return SHRINK

    def prepare_sampler(self, nested_sampler: Any = None, **kwargs: Any) -> Any:
        self.sampler_kwargs.update(bound=nested_sampler.bound)
        return super().prepare_sampler(nested_sampler=nested_sampler, **kwargs)

    def tune(self, tuning_info: Any, update: bool = True) -> None:
        tune_slice(self, tuning_info, update)

    @staticmethod
    def sample(args: Any) -> Any:
        """The pool's part; dynesty never comes here."""
        return _never(args)


@dataclass
class _Place:
    """A batch of new points: u, x (n, k), log likelihood and evaluations (n,)."""

    u: Array
    x: Array
    log_likelihood: Array
    calls: Array

    def returned(self, info: Any) -> list[Any]:
        rows = zip(self.u, self.x, self.log_likelihood.tolist(), self.calls.tolist(), strict=True)
        return [SamplerReturn(u, x, value, int(n), [], info, {}) for u, x, value, n in rows]


class _Proposals:
    """Stands where dynesty expects a pool: ``map`` proposes the whole queue with few vectorised evaluations.

    dynesty fits its bounds when enough calls were reported, so that after the unit cube each point counts as one.
    """

    def __init__(self, problem: Problem, rng: np.random.Generator) -> None:
        self.problem, self.rng = problem, rng
        self.slices = SLICES * problem.size
        self.efficiency = 0.5
        self.pause = 0

    def map(self, function: Any, items: Iterable[Any]) -> list[Any]:
        """Points above the likelihood that ``items`` ask for, one each."""
        asked = list(items)
        first = asked[0]
        bound = first.kwargs.get("bound")
        if bound is None:
            return self._rejection(UnitCube(self.problem.size), first.loglstar, len(asked), np.inf)
        self.pause -= 1
        done: list[Any] = []
        if self.pause < 0:
            most = max(4 * SMALLEST, PER_SLICE * self.slices * len(asked))
            done = [r._replace(ncalls=1) for r in self._rejection(bound, first.loglstar, len(asked), most)]
            if len(done) < len(asked):
                self.pause = PAUSE
        if len(done) < len(asked):
            done += self._slices(asked[len(done) :])
        return done

    def _rejection(self, bound: Any, floor: float, count: int, most: float) -> list[Any]:
        """Up to ``count`` points uniform in the bound and above ``floor``, from ``most`` evaluations."""
        done: list[Any] = []
        tried = pending = 0
        while len(done) < count and tried < most:
            want = int(np.clip(1.1 * (count - len(done)) / self.efficiency, SMALLEST, LARGEST))
            u = _uniform(bound, want, self.rng, self.problem.size)
            if not len(u):
                tried += 1
                continue
            x, value = self.problem.from_cube(u)
            good = np.flatnonzero(value > floor)
            tried += len(u)
            self.efficiency = max(0.8 * self.efficiency + 0.2 * len(good) / len(u), 1e-3)
            calls = np.diff(good, prepend=-1)
            if good.size:
                calls[0] += pending
                pending = 0
            pending += len(u) - 1 - int(good[-1]) if good.size else len(u)
            done += _Place(u[good], x[good], value[good], calls).returned(None)
        return done[:count]

    def _slices(self, asked: list[Any]) -> list[Any]:
        """One point from each start: random slices along directions that the bounds scale, side by side.

        R. M. Neal, Ann. Stat. 31 (2003) 705: stepping out, then shrinking.
        """
        floor, scale = asked[0].loglstar, asked[0].scale
        axes = np.array([a.axes for a in asked]) * scale
        n, k = len(asked), self.problem.size
        start = np.array([a.u for a in asked])
        at = _Place(start, *self.problem.from_cube(start), np.ones(n))
        longest = 0.5 * np.sqrt(k)
        expanded = contracted = 0
        for _ in range(self.slices):
            z = self.rng.standard_normal((n, k))
            way = np.einsum("nij,nj->ni", axes, z / np.linalg.norm(z, axis=1, keepdims=True))
            way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True) / longest, 1.0)
            low = -self.rng.random(n)
            low, high, steps = self._step_out(at.u, way, low, floor)
            expanded += steps
            contracted += self._shrink(at, way, low, high, floor)
        info = {"n_expand": expanded / n, "n_contract": contracted / n, "expansion_warning_set": False}
        return at.returned(info)

    def _step_out(self, u: Array, way: Array, low: Array, floor: float) -> tuple[Array, Array, int]:
        """Ends (n,) outside, found by unit steps from (low, low + 1), and the steps that it took."""
        end, step = np.concatenate([low, low + 1]), np.repeat([-1.0, 1.0], len(low))
        u, way = np.concatenate([u, u]), np.concatenate([way, way])
        steps, going = 0, np.arange(len(u))
        while going.size:
            _, value = self._inside_cube(u[going] + end[going, None] * way[going])
            going = going[value > floor]
            end[going] += step[going]
            steps += going.size
        return end[: len(low)], end[len(low) :], steps

    def _shrink(self, at: _Place, way: Array, low: Array, high: Array, floor: float) -> int:
        """Draw on (low, high) until a point is inside, cutting at those that are not; returns the draws."""
        draws, going, start = 0, np.arange(len(low)), at.u.copy()
        for _ in range(MOST_CUTS):
            if not going.size:
                break
            t = low[going] + self.rng.random(going.size) * (high - low)[going]
            u = start[going] + t[:, None] * way[going]
            x, value = self._inside_cube(u)
            draws += going.size
            good = value > floor
            there = going[good]
            at.u[there], at.x[there], at.log_likelihood[there] = u[good], x[good], value[good]
            t, going = t[~good], going[~good]
            low[going] = np.where(t < 0, t, low[going])
            high[going] = np.where(t < 0, high[going], t)
        return draws

    def _inside_cube(self, u: Array) -> tuple[Array, Array]:
        """x (n, k) and log likelihood (n,) of u (n, k); -inf outside the unit cube."""
        x, value = np.zeros_like(u), np.full(len(u), -np.inf)
        inside = np.all((u > 0) & (u < 1), axis=1)
        if np.any(inside):
            x[inside], value[inside] = self.problem.from_cube(u[inside])
        return x, value


def _uniform(bound: Any, count: int, rng: np.random.Generator, k: int) -> Array:
    """At most ``count`` points (n, k), uniform in the part of the bound that lies in the unit cube."""
    if isinstance(bound, UnitCube) or logsumexp(bound.logvol_ells) > 0:
        return rng.random((count, k))
    share = np.exp(bound.logvol_ells - np.max(bound.logvol_ells))
    which = rng.choice(len(share), size=count, p=share / np.sum(share))
    z = rng.standard_normal((count, k))
    ball = z / np.linalg.norm(z, axis=1, keepdims=True) * rng.random((count, 1)) ** (1 / k)
    axes = np.array([e.axes for e in bound.ells])
    u = bound.ctrs[which] + np.einsum("nij,nj->ni", axes[which], ball)
    u = u[np.all((u > 0) & (u < 1), axis=1)]
    if len(share) > 1 and len(u):
        # A point that q ellipsoids share is kept once in q times.
        d = u[:, None, :] - bound.ctrs
        q = np.sum(np.einsum("nai,aij,naj->na", d, bound.ams, d) < 1, axis=1)
        u = u[rng.random(len(u)) * np.maximum(q, 1) < 1]
    return np.asarray(u)
