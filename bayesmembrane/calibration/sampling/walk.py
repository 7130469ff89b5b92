"""Draws from a posterior by two or more independent ensembles of walkers, and when they are enough.

Where a mixture is found that is close to the posterior, every step is proposed by it; else, and always if that is
asked for, emcee's ensembles walk.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bayesmembrane.calibration.posterior import Outcomes, Posterior, weighed
from bayesmembrane.calibration.sampling.chains import Chains, joined
from bayesmembrane.calibration.sampling.convergence import BURN_TAUS, LEAST_STEPS, LEAST_TAUS, Convergence, convergence
from bayesmembrane.calibration.sampling.growing import picked
from bayesmembrane.calibration.sampling.leaps import BLOCK, blocks, leap, mended, offers
from bayesmembrane.calibration.sampling.proposals.independent import Independent, independent
from bayesmembrane.calibration.sampling.proposals.learned import learn, next_lesson
from bayesmembrane.calibration.sampling.weights import Worth
from bayesmembrane.calibration.starts import Tried, try_points
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.interrupts import Stop, StopAsked, deferred, never
from bayesmembrane.ground.parameters import Array

SAVE_AFTER = 10.0  # s: what a run that is killed loses at most, beside the step that it was at
AHEAD = 2**24  # bytes of steps that wait to be put together with those before
SAMPLERS = ("auto", "emcee")
SURE = 0.02
"""Standard error of ln Z up to which a mixture is drawn from, if `MOST_FOR_Z` draws do for that."""
MOST_FOR_Z = 10_000
LEAST_WALKERS = 12
"""Of each ensemble, where a mixture proposes: fifty autocorrelation times of two are then 1200 draws that count."""
SLOW = 8000
"""Steps for `LEAST_TAUS`, from which on a mixture that holds walkers up is mended, or given up: ensembles that walk
along a narrow valley take longer. (Ogden with a form error, replicate 0 of `tests.studies.sbc` halfway back: 340 s of a
processor by ensembles, to which 1000 steps had led, 45 s by mixtures.)"""
DOUBTED = 5000  # draws of a mixture after which it is looked at for the first time
GIVEN_UP = 2 * DOUBTED
"""Draws from which on a mixture whose weights are not good is given up; until then no draw of it counts."""
MOST_MENDINGS, STRICT_MENDINGS, K_HAT_MENDED = 40, 24, 0.5
"""Times that a mixture is mended before ensembles walk instead; and k-hat that is asked of one that was mended, as long
as that has been done no more often than the second of these: what needed to be mended once may still lack a place that
few proposals have met, and what is asked of others would not show it. (Mooney-Rivlin with relaxation, replicate 10 of
`tests.studies.sbc`: ln Z of three seeds is 0.27 to 0.17 too low with 0.59 to 0.69, 0.12 with 0.53.)"""
GROWTH = 1.25  # a look costs little, but nothing is learned from looking at every step


@dataclass(frozen=True)
class Settings:
    """How to sample.

    ess : wanted effective sample size of the worst coordinate
    ensembles, walkers : independent ensembles, and walkers in each (None: four a coordinate, in sixteens; where a
        mixture proposes two a coordinate, in fours, and `LEAST_WALKERS` at least)
    chunk : steps before the first look at tau
    most_steps : each ensemble stops there, and the run says so
    sampler : "auto" proposes from a mixture where one is close enough, and has emcee's ensembles walk elsewhere;
        "emcee" has them walk everywhere
    """

    ess: float = 1000.0
    ensembles: int = 2
    walkers: int | None = None
    chunk: int = 300
    most_steps: int = 20000
    sampler: str = "auto"

    def __post_init__(self) -> None:
        if self.sampler not in SAMPLERS:
            raise SettingsError(f'there is no sampler "{self.sampler}"', remedy=f"choose {' or '.join(SAMPLERS)}")
        if not 0 < self.ess < np.inf:
            raise SettingsError(
                f"an effective sample size of {self.ess:g} cannot be reached", "ess", "give some hundreds"
            )
        if self.ensembles < 2 or self.chunk < 10 or self.most_steps < self.chunk:
            raise SettingsError(
                "sampling needs two ensembles, chunks of ten steps, and a limit of at least one chunk",
                f"ensembles {self.ensembles}, chunk {self.chunk}, most_steps {self.most_steps}",
            )


@dataclass(frozen=True)
class Progress:
    """What a progress bar shows: ESS of the worst coordinate so far, steps a second, seconds left (nan: unknown),
    part of the proposals that were accepted.
    """

    steps: int
    ess: float
    wanted: float
    r_hat: float
    tau: float
    steps_per_second: float
    seconds_left: float
    acceptance: float = float("nan")


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
        return picked(x, at)[:, :, w].reshape(ensembles, -1, k), picked(lp, at)[:, :, w].reshape(ensembles, -1)


Callback = Callable[[Progress], None]


@dataclass(frozen=True)
class Meanwhile:
    """What is done while the ensembles walk.

    keep : takes what was walked since it was last called: the starts, what `SAVE_AFTER` seconds brought, and the end
    stop : asked after every step whether to end there
    """

    keep: Callable[[Chains], None] = lambda part: None
    stop: Stop = never


NOTHING = Meanwhile()


def run_ensembles(
    posterior: Posterior,
    settings: Settings,
    seed: int,
    progress: Callback | None = None,
    chains: Chains | None = None,
    beside: Meanwhile = NOTHING,
) -> Sampled:
    """Walk until tau is known (at least 50 tau steps), ESS = steps x walkers / tau is reached for the worst
    coordinate and R-hat between ensembles is at most 1.01, or until the limit of steps.

    ``chains`` continues an earlier run as if it had never stopped, wherever that was. SIGINT and SIGTERM end the walk
    after the step that is being made, not the program, as ``beside.stop`` does: what was walked is kept, and returned
    with the status "interrupted". A second signal ends the step, too.
    """
    fresh = chains is None
    chains = started(posterior, settings, seed) if chains is None else chains
    walk = _Walk(posterior, beside, chains)
    judged: tuple[object, Convergence] | None = None
    target, status = min(chains.look, settings.most_steps) or max(settings.chunk, chains.steps), "interrupted"
    with deferred(beside.stop) as asked, suppress(KeyboardInterrupt):
        if fresh:  # from here on whoever sees that something is kept may stop the walk
            beside.keep(chains)
        while walk.on_to(target, asked):
            found = convergence(walk.chains)
            judged = (walk.chains.steps, walk.chains.lessons), found
            if progress is not None:
                progress(_progress(walk.chains, found, settings))
            if found.enough(settings.ess) and _good(walk.chains):
                status = "converged"
                break
            if walk.chains.steps >= settings.most_steps:
                status = "step limit"
                break
            if not _worth_it(walk.chains, found) and walk.mend():
                target = min(settings.most_steps, walk.chains.look)
                continue
            if walk.chains.steps >= next_lesson(walk.chains) or not _worth_it(walk.chains, found):
                walk.learn()
            target = min(settings.most_steps, _next_look(walk.chains, found, settings))
        if asked.signalled:  # a signal that came at the very end still ends what follows
            status = "interrupted"
    walk.save()
    same = judged is not None and judged[0] == (walk.chains.steps, walk.chains.lessons)
    return Sampled(walk.chains, judged[1] if judged and same else convergence(walk.chains), status)


def _good(chains: Chains) -> bool:
    """Whether what was offered so far allows to go on as before.

    One that was mended once may have more to be mended: it is asked for more as long as it can be.
    """
    if chains.mixture is None:
        return True
    found = offers(chains)
    mending = 0 < len(chains.lessons) < STRICT_MENDINGS
    return found.good and (not mending or found.k_hat < K_HAT_MENDED)


def _worth_it(chains: Chains, found: Convergence) -> bool:
    """Whether it is still worth while to have a mixture propose, if one does."""
    if chains.mixture is None or chains.offered is None:
        return True
    slow = LEAST_TAUS * float(np.max(found.tau)) > SLOW
    # Few weights that end at a bound, as where the prior is cut, look like a tail: they are given some more.
    few = chains.offered[:, chains.learned :].size < GIVEN_UP
    return not slow and (_good(chains) or few)


def _next_look(chains: Chains, found: Convergence, settings: Settings) -> int:
    """The steps at which everything may be there, within GROWTH of what was walked."""
    steps = chains.steps
    if steps < LEAST_STEPS:
        return LEAST_STEPS  # until then nothing is known
    tau = float(np.max(found.tau))
    needed = max(LEAST_TAUS * tau, (steps - found.burn) * settings.ess / float(np.min(found.ess)))
    guess = int(np.ceil(needed * 1.02)) + found.burn
    if chains.mixture is not None:
        judged, twice = offers(chains), 2 * steps - chains.learned
        if not _good(chains):
            return blocks(twice)
        for_z = chains.learned + _proposals_for_z(judged) / chains.log_posterior[:, 0].size
        return blocks(min(max(guess, for_z, steps + BLOCK), twice))
    return int(
        min(max(guess, steps + settings.chunk // 2, int(1.1 * steps)), max(int(GROWTH * steps), 2 * settings.chunk))
    )


def _proposals_for_z(judged: Worth) -> float:
    """How many give ln Z to within `SURE`, as far as `MOST_FOR_Z` do."""
    return min(MOST_FOR_Z, (1 / judged.efficiency - 1) / SURE**2) if judged.efficiency > 0 else 0.0


def _progress(chains: Chains, found: Convergence, settings: Settings) -> Progress:
    rate = chains.steps / max(chains.seconds, 1e-9)
    least, tau = float(np.min(found.ess)), float(np.max(found.tau))
    left = float("nan")
    if least > 0:
        needed = max(LEAST_TAUS * tau, (chains.steps - found.burn) * settings.ess / least) + found.burn
        left = max(0.0, (needed - chains.steps) / rate)
    r_hat = float(np.max(found.r_hat))
    return Progress(chains.steps, least, settings.ess, r_hat, tau, rate, left, found.acceptance)


def walkers_of(posterior: Posterior, settings: Settings) -> int:
    """Walkers in each ensemble."""
    # Half an ensemble moves at a time, and the solver takes films by eights; tau grows when there are fewer.
    return settings.walkers or 16 * -(-4 * posterior.size // 16)


Search = Callable[[Any, np.random.Generator, int, Outcomes], Tried]
"""What finds so many possible points of a posterior or more, and counts what became of all."""


def started(posterior: Posterior, settings: Settings, seed: int, search: Search = try_points) -> Chains:
    """Ensembles at different overdispersed starts, or at draws of a mixture that is close to the posterior."""
    began, counts = time.perf_counter(), Outcomes()
    rng = np.random.default_rng(np.random.SeedSequence(seed).spawn(settings.ensembles + 1)[-1])
    shape = settings.ensembles, walkers_of(posterior, settings)
    found = search(posterior, rng, shape[0] * shape[1], counts)
    x, close = found.starts(rng, *shape), None
    if settings.sampler == "auto":
        close = independent(posterior, found, rng.spawn(1)[0], counts)
    chains = begun(posterior, x, seed) if close is None else _begun_from_mixture(posterior, close, settings, seed)
    return replace(chains, counts=counts, seconds=time.perf_counter() - began)


def _begun_from_mixture(posterior: Posterior, close: Independent, settings: Settings, seed: int) -> Chains:
    """Ensembles at states of a mixture, to be looked at where they may be worth enough."""
    # Steps that hang on no other walker need no more of them than emcee's ensembles to go on with.
    walkers = settings.walkers or 4 * -(-max(2 * posterior.size, LEAST_WALKERS) // 4)
    count = settings.ensembles * walkers
    states = np.resize(close.states, (settings.ensembles, walkers, posterior.size))
    chains = begun(posterior, states, seed)
    tau = close.worth.tau
    enough = max((LEAST_TAUS + BURN_TAUS) * tau, (BURN_TAUS + settings.ess / count) * tau)
    needed = min(max(enough, _proposals_for_z(close.worth) / count), DOUBTED / count)
    offered = np.full(chains.log_posterior.shape, np.nan)
    return replace(chains, mixture=close.mixture, offered=offered, look=min(blocks(needed), settings.most_steps))


def begun(posterior: Posterior, x: Array, seed: int) -> Chains:
    """Ensembles that stand at x (E, W, k), with generators of their own."""
    seeds = np.random.SeedSequence(seed).spawn(len(x) + 1)
    states = tuple(np.random.RandomState(np.random.MT19937(s)).get_state() for s in seeds[:-1])
    lp = np.stack([weighed(posterior, e).log_posterior for e in x])
    return Chains(x[:, None], lp[:, None], states, Outcomes(), 0.0)


@dataclass
class _Pile:
    """The steps after ``first`` until they are put together: (E, walkers, k), (E, walkers), and, where a mixture
    proposes, what was offered, (E, walkers).
    """

    first: int
    steps: list[tuple[Array, ...]] = field(default_factory=list)

    @property
    def size(self) -> int:
        """Bytes that it holds."""
        return len(self.steps) * sum(v.nbytes for v in self.steps[0]) if self.steps else 0

    def part(self, begin: int, end: int, standing: Chains) -> Chains | None:
        """The steps from ``begin`` to ``end``, a part that stands where ``standing`` does; None if there are none."""
        steps = self.steps[begin - self.first : end - self.first]
        if not steps:
            return None
        x, lp, *offered = (np.stack(values, axis=1) for values in zip(*steps, strict=True))
        return replace(standing, x=x, log_posterior=lp, offered=offered[0] if offered else None)

    def emptied(self, end: int) -> None:
        """Begin anew behind the step ``end``."""
        self.first, self.steps = end, []


@dataclass
class _Walk:
    """A walk that is being made: all ensembles step by step, so that they are equally long wherever it ends.

    chains : what was walked until the last look, or until `AHEAD`
    standing : (steps, state) after the last step that all ensembles made
    ahead, unsaved : what was walked since then, and since something was last kept
    """

    posterior: Posterior
    beside: Meanwhile
    chains: Chains

    def __post_init__(self) -> None:
        self.counts = Outcomes(self.chains.counts)
        self.began = time.perf_counter() - self.chains.seconds
        self.saved = time.perf_counter()
        self.standing = (self.chains.steps, self.chains)
        self.ahead, self.unsaved = _Pile(self.chains.steps), _Pile(self.chains.steps)
        self.known = learn(self.posterior, self.chains)

    def learn(self) -> None:
        """Have emcee's ensembles propose from now on what can be known by now."""
        if self.chains.mixture is not None:
            self.save()  # a segment holds steps of one kind
            self.chains = replace(self.chains, mixture=None, offered=None, leapt=self.chains.steps)
        self.chains = replace(self.chains, lessons=(*self.chains.lessons, self.chains.steps))
        self.standing = (self.chains.steps, self.chains)
        self.known = learn(self.posterior, self.chains)

    def mend(self) -> bool:
        """Have a better mixture propose from now on; False if it was mended often enough, or cannot be."""
        if self.chains.mixture is None or len(self.chains.lessons) >= MOST_MENDINGS:
            return False
        mixture = mended(self.posterior, self.chains)
        if mixture is None:
            return False
        self.save()  # a segment holds steps of one mixture
        steps, count = self.chains.steps, self.chains.log_posterior[:, 0].size
        look = steps + blocks(DOUBTED / count)
        self.chains = replace(self.chains, mixture=mixture, lessons=(*self.chains.lessons, steps), look=look)
        self.standing = (steps, self.chains)
        return True

    def on_to(self, look: int, asked: StopAsked) -> bool:
        """Walk to the next lesson, or to the ``look`` if that comes first; False if asked to stop before."""
        # A walk that goes on may stand at its lesson, or beyond the look of one that wanted less: it is judged first.
        end = max(self.chains.steps, min(look, next_lesson(self.chains)))
        try:
            self._walk(end - self.chains.steps, look, asked)
        finally:
            self._gather()
        return self.chains.steps >= end and not asked.signalled

    def save(self) -> None:
        """Have what was walked kept."""
        part = self.unsaved.part(self.unsaved.first, *self.standing)
        self.unsaved.emptied(self.standing[0])
        if part is not None:
            self.beside.keep(part)
        self.saved = time.perf_counter()

    def _gather(self) -> None:
        """Have what was walked ahead with the rest of the walk."""
        if (part := self.ahead.part(self.chains.steps, *self.standing)) is not None:
            self.chains = joined([self.chains, part])
            self.standing = (self.chains.steps, self.chains)
        self.ahead.emptied(self.chains.steps)

    def _walk(self, steps: int, look: int, asked: StopAsked) -> None:
        """At most ``steps`` more; what an interruption cuts is dropped."""
        if steps <= 0:
            return
        if self.chains.mixture is not None:
            self._leap(steps, look, asked)
            return
        samplers = [self._sampler(steps, e) for e in range(len(self.chains.x))]
        for _ in range(steps):
            if asked():
                break
            states = [next(s) for s in samplers]
            # Copies, for emcee changes its state in place.
            made = np.stack([s.coords for s in states]), np.stack([s.log_prob for s in states])
            self._made([made], tuple(s.random_state for s in states), look)

    def _leap(self, steps: int, look: int, asked: StopAsked) -> None:
        """The same by proposals of the mixture, a block at a time."""
        mixture, end = self.chains.mixture, self.standing[0] + steps
        assert mixture is not None
        standing = self.chains
        while (at := self.standing[0]) < end and not asked():
            found = leap(self.posterior, mixture, standing, min(end, at - at % BLOCK + BLOCK) - at, self.counts)
            parts = (np.moveaxis(v, 1, 0) for v in (found.x, found.log_posterior, found.offered))
            self._made(list(zip(*parts, strict=True)), found.random_states, look)
            standing = replace(
                standing, x=found.x, log_posterior=found.log_posterior, random_states=found.random_states
            )

    def _made(self, steps: list[tuple[Array, ...]], random_states: tuple[Any, ...], look: int) -> None:
        """Take ``steps`` into what was walked, and have it kept if it is time."""
        self.ahead.steps += steps
        self.unsaved.steps += steps
        # In one go: an interruption must not part the steps from the state after them.
        self.standing = (
            self.standing[0] + len(steps),
            replace(
                self.chains,
                random_states=random_states,
                counts=Outcomes(self.counts),
                seconds=time.perf_counter() - self.began,
                look=look,
            ),
        )
        if time.perf_counter() - self.saved >= SAVE_AFTER:
            self.save()
        if self.ahead.size > AHEAD:
            self._gather()

    def _sampler(self, steps: int, ensemble: int) -> Any:
        """The steps of an ensemble that moves by differential evolution, snooker and stretch, and by what is known."""
        import emcee  # on demand: it imports scipy.stats, which takes a second

        def log_probability(x: Array) -> Array:
            e = weighed(self.posterior, x)
            self.counts.note(x, e.outcome)
            return e.log_posterior

        x, lp = self.chains.x[ensemble, -1], self.chains.log_posterior[ensemble, -1]
        moves = self.known.moves()
        sampler = emcee.EnsembleSampler(*x.shape, log_probability, moves=moves, vectorize=True)
        # emcee's own wrapper prints a traceback of whatever is raised, Ctrl-C among it.
        sampler.log_prob_fn = log_probability
        start = emcee.State(x, lp, random_state=self.chains.random_states[ensemble])
        return sampler.sample(start, iterations=steps, store=False, skip_initial_state_check=True)
