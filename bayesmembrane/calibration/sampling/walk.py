"""Draws from a posterior by two or more independent ensembles of walkers: emcee's loop, and when it may stop."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import emcee
import numpy as np

from bayesmembrane.calibration.posterior import Posterior, tally
from bayesmembrane.calibration.sampling.chains import Chains
from bayesmembrane.calibration.sampling.convergence import LEAST_TAUS, Convergence, convergence
from bayesmembrane.calibration.sampling.proposals.learned import Learned, learn, next_lesson
from bayesmembrane.calibration.starts import starting_points
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array

GROWTH = 1.25  # a look costs little, but nothing is learned from looking at every step


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
    sampler = _sampler(posterior, walkers, counts, learn(posterior, chains))
    target, status = max(settings.chunk, chains.steps), "interrupted"
    try:
        while True:
            lesson = next_lesson(chains)
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
            if chains.steps >= next_lesson(chains):
                chains = replace(chains, lessons=(*chains.lessons, chains.steps))
                sampler = _sampler(posterior, walkers, counts, learn(posterior, chains))
            target = min(settings.most_steps, _next_look(chains.steps, found, settings))
    except KeyboardInterrupt:
        found = convergence(chains)
    return Sampled(chains, found, status)


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


def _sampler(posterior: Posterior, walkers: int, counts: Counter[str], known: Learned) -> Any:
    """An ensemble that proposes by differential evolution, snooker and stretch, and from what was ``known`` by then."""

    def log_probability(x: Array) -> Array:
        e = posterior.evaluate(x)
        counts.update(tally(e.outcome))
        return e.log_posterior

    sampler = emcee.EnsembleSampler(walkers, posterior.size, log_probability, moves=known.moves(), vectorize=True)
    # emcee's own wrapper prints a traceback of whatever is raised, Ctrl-C among it.
    sampler.log_prob_fn = log_probability
    return sampler


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
