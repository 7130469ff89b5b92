"""Draws from a posterior by two or more independent ensembles of walkers; the only file that knows emcee."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import emcee
import numpy as np
from emcee.autocorr import integrated_time

from bayesmembrane.calibration.posterior import Posterior, tally
from bayesmembrane.calibration.sampling.proposals.emulator import Emulator, emulate
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture, fit_mixture
from bayesmembrane.calibration.starts import starting_points
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.quiet import arviz

LEAST_TAUS = 50
BURN_TAUS = 10
LEAST_STEPS = 20  # fewer say nothing
R_HAT = 1.01
GROWTH = 1.25  # a look costs little, but nothing is learned from looking at every step
FIRST_LESSON, NEXT_LESSON = 100, 2
"""The proposal is learned from the chains after so many steps, and anew whenever there are so many times as many,
until the run converges. What came before the last lesson never counts: only a fixed proposal makes a chain."""
WALK_SHARE, JUMP_SHARE, LEARN_FROM = 0.4, 0.3, 2000


@dataclass(frozen=True)
class Settings:
    """How to sample.

    ess : wanted effective sample size of the worst coordinate
    ensembles, walkers : independent ensembles, and walkers in each (None: four a coordinate, in sixteens)
    chunk : steps before the first look at tau
    most_steps : each ensemble stops there, and the run says so
    """

    ess: float = 1000.0
    ensembles: int = 2
    walkers: int | None = None
    chunk: int = 300
    most_steps: int = 20000

    def __post_init__(self) -> None:
        if not self.ess > 0 or self.ensembles < 2 or self.chunk < 10 or self.most_steps < self.chunk:
            raise SettingsError(
                "sampling needs a positive ESS, two ensembles, and a limit of at least one chunk of steps"
            )


@dataclass(frozen=True)
class Progress:
    """What a progress bar shows: ESS of the worst coordinate so far, steps a second, seconds left (nan: unknown)."""

    steps: int
    ess: float
    wanted: float
    r_hat: float
    tau: float
    steps_per_second: float
    seconds_left: float


@dataclass(frozen=True, eq=False)
class Chains:
    """Everything that the ensembles walked, and where they stand: what resuming needs.

    Attributes
    ----------
    x : (E, steps, walkers, k) coordinates, in order
    log_posterior : (E, steps, walkers)
    random_states : state of each ensemble's generator, as NumPy gives it
    counts : outcomes of all evaluations, by label
    seconds : time spent
    lessons : steps after which the proposal was learned
    """

    x: Array
    log_posterior: Array
    random_states: tuple[Any, ...]
    counts: Counter[str]
    seconds: float
    lessons: tuple[int, ...] = ()

    @property
    def steps(self) -> int:
        return int(self.x.shape[1])

    @property
    def evaluations(self) -> int:
        return sum(self.counts.values())


@dataclass(frozen=True, eq=False)
class Convergence:
    """What the chains are worth.

    Attributes
    ----------
    tau : (k,) integrated autocorrelation time in steps, averaged over walkers as emcee does, the worst ensemble's
    burn : steps left out at the start, the same in all ensembles
    ess : (k,) (steps - burn) x walkers / tau, added over ensembles
    r_hat : (k,) rank-normalised, between the halves of the ensembles (A. Vehtari et al., Bayesian Anal. 16 (2021) 667)
    acceptance : part of the proposals that were accepted after burn-in
    lengths : (steps - burn) / max tau
    """

    tau: Array
    burn: int
    ess: Array
    r_hat: Array
    acceptance: float
    lengths: float

    def enough(self, wanted: float) -> bool:
        """True if tau can be believed, every ESS is at least ``wanted`` and every R-hat at most 1.01."""
        return bool(self.lengths >= LEAST_TAUS and np.min(self.ess) >= wanted and np.max(self.r_hat) <= R_HAT)


@dataclass(frozen=True, eq=False)
class Sampled:
    """Chains, their worth, and how it ended: "converged", "step limit" or "interrupted"."""

    chains: Chains
    convergence: Convergence
    status: str

    def draws(self, most: int) -> tuple[Array, Array]:
        """(E, D, k) coordinates and (E, D) log posteriors after burn-in, thinned to at most ``most`` draws in all.

        Steps are thinned first and walkers only if that does not do: walkers of one step are nearly independent.
        """
        x, lp = self.chains.x[:, self.convergence.burn :], self.chains.log_posterior[:, self.convergence.burn :]
        ensembles, steps, walkers, k = x.shape
        keep = max(1, min(steps, most // (ensembles * walkers)))
        at = np.linspace(0, steps - 1, keep).round().astype(int)
        w = slice(0, max(1, min(walkers, most // (ensembles * keep))))
        return x[:, at, w].reshape(ensembles, -1, k), lp[:, at, w].reshape(ensembles, -1)


Callback = Callable[[Progress], None]


def run_ensembles(
    posterior: Posterior,
    settings: Settings,
    seed: int,
    progress: Callback | None = None,
    chains: Chains | None = None,
) -> Sampled:
    """Walk until tau is known (at least 50 tau steps), ESS = steps x walkers / tau is reached for the worst
    coordinate and R-hat between ensembles is at most 1.01, or until the limit of steps.

    ``chains`` continues an earlier run as if it had never stopped. Ctrl-C ends the walk, not the program: what was
    walked is returned with the status "interrupted".
    """
    counts: Counter[str] = Counter() if chains is None else Counter(chains.counts)
    walkers = _walkers(posterior, settings) if chains is None else chains.x.shape[2]
    began = time.perf_counter() - (0.0 if chains is None else chains.seconds)
    if chains is None:
        chains = _start(posterior, settings, seed, counts)
    sampler = _sampler(posterior, walkers, counts, learned(posterior, chains))
    target, status = max(settings.chunk, chains.steps), "interrupted"
    try:
        while True:
            lesson = _next_lesson(chains)
            stop = target if lesson <= chains.steps else min(target, lesson)
            chains = _walk(sampler, chains, stop, counts, began)
            found = convergence(chains)
            if progress is not None:
                progress(_progress(chains, found, settings))
            if found.enough(settings.ess):
                status = "converged"
                break
            if chains.steps >= settings.most_steps:
                status = "step limit"
                break
            if chains.steps >= _next_lesson(chains):
                chains = replace(chains, lessons=(*chains.lessons, chains.steps))
                sampler = _sampler(posterior, walkers, counts, learned(posterior, chains))
            target = min(settings.most_steps, _next_look(chains.steps, found, settings))
    except KeyboardInterrupt:
        found = convergence(chains)
    return Sampled(chains, found, status)


def convergence(chains: Chains) -> Convergence:
    """Autocorrelation times, burn-in, ESS, R-hat and acceptance of what was walked so far.

    Burn-in is ten autocorrelation times of the second half, and half of the steps at most, but all the steps from which
    the proposal was learned.
    """
    steps, walkers = chains.x.shape[1:3]
    if steps < LEAST_STEPS:
        unknown = np.full(chains.x.shape[3], np.inf)
        return Convergence(unknown, 0, 1 / unknown, unknown, 0.0, 0.0)
    learned = max((s for s in chains.lessons if s <= steps - LEAST_STEPS), default=0)
    tau = _tau(chains.x[:, max(learned, steps // 2) :])
    burn = max(learned, min(steps // 2, int(np.ceil(BURN_TAUS * np.max(tau)))))
    kept = chains.x[:, burn:]
    tau = _tau(kept)
    flat = kept[:, :: max(1, int(np.max(tau) / 4))].reshape(kept.shape[0], -1, kept.shape[-1])
    moved = np.any(kept[:, 1:] != kept[:, :-1], axis=-1)
    return Convergence(
        tau=np.max(tau, axis=0),
        burn=burn,
        ess=np.sum(kept.shape[1] * walkers / tau, axis=0),
        r_hat=np.array([_r_hat(flat[:, :, i]) for i in range(flat.shape[-1])]),
        acceptance=float(np.mean(moved)) if moved.size else 0.0,
        lengths=float(kept.shape[1] / np.max(tau)),
    )


def _r_hat(flat: Array) -> float:
    """Rank-normalised R-hat of (E, draws) in order of time: arviz splits each ensemble into halves itself."""
    if flat.shape[1] < 4 or np.ptp(flat) == 0:
        return np.inf
    return float(arviz.rhat(flat, method="rank"))  # type: ignore[no-untyped-call]


def _tau(x: Array) -> Array:
    """(E, k) integrated autocorrelation times of x (E, steps, walkers, k); at least one step."""
    with np.errstate(all="ignore"):
        tau = np.array([integrated_time(e, tol=0, quiet=True) for e in x])
    return np.where(np.isfinite(tau), np.maximum(tau, 1.0), len(x[0]))


def _next_look(steps: int, found: Convergence, settings: Settings) -> int:
    """The steps at which everything may be there, within GROWTH of what was walked."""
    tau = float(np.max(found.tau))
    needed = max(LEAST_TAUS * tau, (steps - found.burn) * settings.ess / float(np.min(found.ess)))
    guess = int(np.ceil(needed * 1.02)) + found.burn
    return int(
        min(max(guess, steps + settings.chunk // 2, int(1.1 * steps)), max(int(GROWTH * steps), 2 * settings.chunk))
    )


def _progress(chains: Chains, found: Convergence, settings: Settings) -> Progress:
    rate = chains.steps / max(chains.seconds, 1e-9)
    least, tau = float(np.min(found.ess)), float(np.max(found.tau))
    needed = max(LEAST_TAUS * tau, (chains.steps - found.burn) * settings.ess / least) + found.burn
    left = max(0.0, (needed - chains.steps) / rate)
    return Progress(chains.steps, least, settings.ess, float(np.max(found.r_hat)), tau, rate, left)


def _walkers(posterior: Posterior, settings: Settings) -> int:
    # Half an ensemble moves at a time, and the solver takes films by eights; tau grows when there are fewer.
    return settings.walkers or 16 * -(-4 * posterior.size // 16)


def learned(posterior: Posterior, chains: Chains) -> tuple[Emulator | None, Mixture | None]:
    """What proposals are made from, learned from the later part of what all ensembles walked until the last lesson.

    An emulator of the curves to walk on, and t-distributions to jump to: one is right where curves are smooth in the
    parameters, the other where they are not but the posterior is compact. None where there is nothing to learn from.
    Both follow from the chains alone, so that a run that was interrupted learns the same again.
    """
    if not chains.lessons:
        return None, None
    end = chains.lessons[-1]
    x, rng = chains.x[:, end // 4 : end].reshape(-1, chains.x.shape[-1]), np.random.default_rng(end)
    found: list[Any] = []
    for learn in (
        lambda: emulate(posterior, x, rng),
        lambda: fit_mixture(x[rng.permutation(len(x))[:LEARN_FROM]], rng),
    ):
        try:
            found.append(learn())
        except np.linalg.LinAlgError:
            found.append(None)
    return found[0], found[1]


def _next_lesson(chains: Chains) -> int:
    """Steps after which the proposal may be learned (anew)."""
    return int(NEXT_LESSON * chains.lessons[-1]) if chains.lessons else FIRST_LESSON


def _sampler(
    posterior: Posterior, walkers: int, counts: Counter[str], known: tuple[Emulator | None, Mixture | None]
) -> Any:
    """An ensemble that proposes by differential evolution, snooker and stretch, and from what was ``known`` by then.

    The first two suit curved valleys; differential evolution with gamma = 1 jumps between valleys.
    """

    def log_probability(x: Array) -> Array:
        e = posterior.evaluate(x)
        counts.update(tally(e.outcome))
        return e.log_posterior

    emulator, mixture = known
    moves: list[tuple[Any, float]] = []
    if emulator is not None:
        moves.append((emcee.moves.MHMove(_walking(emulator)), WALK_SHARE))
    if mixture is not None:
        moves.append((emcee.moves.MHMove(_jumping(mixture)), JUMP_SHARE))
    share = 1 - sum(weight for _, weight in moves)
    moves += [
        (emcee.moves.DEMove(), 0.6 * share),
        (emcee.moves.DEMove(gamma0=1.0), 0.1 * share),
        (emcee.moves.DESnookerMove(), 0.1 * share),
        (emcee.moves.StretchMove(), 0.2 * share),
    ]
    return emcee.EnsembleSampler(walkers, posterior.size, log_probability, moves=moves, vectorize=True)


Proposal = Callable[[Array, Any], tuple[Array, Array]]


def _walking(emulator: Emulator) -> Proposal:
    """The proposal of a Metropolis-Hastings move: where a walk on the emulator ends, and its factor."""

    def propose(x: Array, random: Any) -> tuple[Array, Array]:
        return emulator.walk(x, _generator(random))

    return propose


def _jumping(mixture: Mixture) -> Proposal:
    """The proposal y ~ g whatever the place x, with the factor ln g(x) - ln g(y).

    W. K. Hastings, Biometrika 57 (1970) 97.
    """

    def propose(x: Array, random: Any) -> tuple[Array, Array]:
        y = mixture.draw(_generator(random), len(x))
        return y, mixture.log_density(x) - mixture.log_density(y)

    return propose


def _generator(random: Any) -> np.random.Generator:
    return np.random.default_rng(random.randint(2**31, size=4))


def _start(posterior: Posterior, settings: Settings, seed: int, counts: Counter[str]) -> Chains:
    """Ensembles at different overdispersed starts, with generators of their own."""
    walkers = _walkers(posterior, settings)
    seeds = np.random.SeedSequence(seed).spawn(settings.ensembles + 1)
    x = starting_points(posterior, np.random.default_rng(seeds[-1]), settings.ensembles, walkers, counts)
    states = tuple(np.random.RandomState(np.random.MT19937(s)).get_state() for s in seeds[:-1])
    lp = np.stack([posterior.evaluate(e).log_posterior for e in x])
    return Chains(x[:, None], lp[:, None], states, counts, 0.0)


def _walk(sampler: Any, chains: Chains, target: int, counts: Counter[str], began: float) -> Chains:
    """Advance every ensemble to ``target`` steps; what an interruption cuts is dropped: all stay equally long."""
    more = target - chains.steps
    if more <= 0:
        return chains
    x, lp, states = [], [], []
    for e in range(len(chains.x)):
        sampler.reset()
        start = emcee.State(chains.x[e, -1], chains.log_posterior[e, -1], random_state=chains.random_states[e])
        xs, lps = np.empty((more, *chains.x.shape[2:])), np.empty((more, chains.x.shape[2]))
        state = start
        for i, state in enumerate(sampler.sample(start, iterations=more, store=False, skip_initial_state_check=True)):
            xs[i], lps[i] = state.coords, state.log_prob
        x.append(np.concatenate([chains.x[e], xs]))
        lp.append(np.concatenate([chains.log_posterior[e], lps]))
        states.append(state.random_state)
    seconds = time.perf_counter() - began
    return Chains(np.stack(x), np.stack(lp), tuple(states), Counter(counts), seconds, chains.lessons)
