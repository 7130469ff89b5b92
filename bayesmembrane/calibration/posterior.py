"""ln p(x | y) + const of a hypothesis, for many draws at once, with the reason where it is zero."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayesmembrane.calibration.prior import JointPrior
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.form_error import traces
from bayesmembrane.physics.forward import AT_ONCE, Forward, Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.mechanics.solution import Status
from bayesmembrane.physics.nodes import Nodes, nodes_of
from bayesmembrane.physics.noise.base import NoiseLikelihood


class Outcome(IntEnum):
    """What became of one draw. All but `OK` have no posterior density; the last two because the numbers failed."""

    OK = 0
    LOCKED = 1
    NOT_ELLIPTIC = 2
    INDEFINITE = 3
    UNRESOLVED = 4
    ITERATION_LIMIT = 5
    NOT_CONVEX = 6

    @property
    def label(self) -> str:
        return self.name.lower().replace("_", " ")


PHYSICAL = tuple(s for s in Status if s.physical)
FAILURES = (Outcome.UNRESOLVED, Outcome.ITERATION_LIMIT)


@dataclass(frozen=True)
class Densities:
    """What B draws weigh.

    log_prior, log_likelihood : (B,), -inf where they are zero; the prior is untruncated times the convexity indicator,
        so that the normalised one is larger by -ln(mass)
    outcome : (B,) `Outcome` codes
    """

    log_prior: Array
    log_likelihood: Array
    outcome: NDArray[np.int8]

    @property
    def log_posterior(self) -> Array:
        """(B,) the sum, without the evidence."""
        return self.log_prior + self.log_likelihood


@dataclass(frozen=True)
class Evaluation(Densities):
    """What B draws weigh, and their curves.

    force : (B, N) N; nan where there is none, or where a film that the prior rules out was not followed
    traces : (B, E, N) N, what each effect changes of the force, where the noise asks for it; else None
    """

    force: Array
    traces: Array | None = None

    @property
    def curves(self) -> Array:
        """(B, N) or (B, (1 + E) N) N: all that the likelihood is made of; forces, and after them the traces."""
        if self.traces is None:
            return self.force
        return np.concatenate([self.force, self.traces.reshape(len(self.force), -1)], axis=1)


class Evaluates(Protocol):
    """A posterior of one test, or of several."""

    @property
    def readings(self) -> int:
        """Of all tests."""

    def evaluate(self, x: Array, /) -> Evaluation:
        """Prior, likelihood, force and outcome of x (B, k), from one batched solution."""


class Given(Protocol):
    """A posterior that is told the curves."""

    def given(self, curves: Array, x: Array, /) -> Array:
        """(B,) ln prior + ln likelihood of x (B, k) if theirs were ``curves`` (B, N), as an `Evaluation` has them."""


@runtime_checkable
class Marginalised(Evaluates, Protocol):
    """A posterior of some of the coordinates of another: the rest is integrated out."""

    def whole(self, x: Array, /) -> Array:
        """(B, k) all coordinates of films with the coordinates x (B, m)."""


def weighed(posterior: Evaluates, x: Array) -> Densities:
    """What draws x (B, k) weigh, however many there are: their curves are kept for a part of them at a time."""
    rows = max(1, AT_ONCE // posterior.readings)
    if len(x) <= rows:
        return posterior.evaluate(x)
    parts = [posterior.evaluate(x[i : i + rows]) for i in range(0, len(x), rows)]
    return Densities(
        np.concatenate([p.log_prior for p in parts]),
        np.concatenate([p.log_likelihood for p in parts]),
        np.concatenate([p.outcome for p in parts]),
    )


def solved_in_parts(posterior: Evaluates, x: Array) -> tuple[Array, Array]:
    """(log posterior (B,), curves (B, M)) of draws x (B, k), all else for a part of them at a time."""
    rows = max(1, AT_ONCE // posterior.readings)
    density, parts = [], []
    for i in range(0, max(len(x), 1), rows):
        found = posterior.evaluate(x[i : i + rows])
        density.append(found.log_posterior)
        parts.append(found.curves)
    if len(parts) == 1:
        return density[0], parts[0]
    # A part without any curve has no traces, either.
    curves = np.empty((len(x), max(part.shape[1] for part in parts)))
    for i in range(0, len(x), rows):
        part = parts.pop(0)
        curves[i : i + rows, : part.shape[1]] = part
        curves[i : i + rows, part.shape[1] :] = np.nan
    return np.concatenate(density), curves


@dataclass(frozen=True, eq=False)
class Posterior:
    """p(x | y) ~ p0(x) 1[convex] N(y - F(x); 0, Sigma(x)).

    Raises `SettingsError` when made from fewer points than the curve has parameters, or from a noise model that has
    nothing to go by.
    """

    hypothesis: Hypothesis
    measurement: Measurement
    solve: Solve = api.solve

    def __post_init__(self) -> None:
        enough_points(self.hypothesis, self.measurement)
        object.__setattr__(self, "hypothesis", self.hypothesis.on(self.measurement))
        self.noise  # noqa: B018 - what it cannot do is said at once

    @cached_property
    def prior(self) -> JointPrior:
        return JointPrior(self.hypothesis)

    @cached_property
    def forward(self) -> Forward:
        return Forward(self.hypothesis, self.measurement, self.measurement.deflection, self.solve)

    @cached_property
    def nodes(self) -> Nodes | None:
        """From which the forces at all readings of a long curve follow, if they do."""
        return nodes_of(self.forward)

    @cached_property
    def unit_curves(self) -> dict[bytes, Array]:
        """Curves (N,) for Gd = 1 of films that were solved, by their shapes (`Collapsed.remember`)."""
        return {}

    @cached_property
    def noise(self) -> NoiseLikelihood:
        return self.hypothesis.noise.bind(self.measurement)

    @property
    def with_weaker_convexity(self) -> Posterior | None:
        """The same with the next weaker convexity prior; None if its own asks nothing."""
        mode = self.hypothesis.convexity.weaker
        return None if mode is None else replace(self, hypothesis=replace(self.hypothesis, convexity=mode))

    @property
    def size(self) -> int:
        """k, the number of coordinates."""
        return len(self.hypothesis.parameters)

    @property
    def curve_size(self) -> int:
        """How many of them shape the curve; those of the noise come last."""
        return self.hypothesis.curve_size

    @property
    def readings(self) -> int:
        """N"""
        return len(self.measurement)

    @property
    def measured(self) -> Array:
        """(N,) N: the measured curve, in the way in which `evaluate` tells forces."""
        return self.measurement.force

    def evaluate(self, x: ArrayLike) -> Evaluation:
        """Prior, likelihood, force and outcome of x (B, k), from one batched solution."""
        x = np.atleast_2d(np.asarray(x, dtype=float))
        every_force, status, inside = self._solved(x)
        ok = np.all(status == Status.OK, axis=1)
        log_likelihood, every = np.full(len(x), -np.inf), None
        if np.any(ok):
            force = every_force[ok]
            shown = self._traces(x[ok], force)
            with np.errstate(over="ignore", invalid="ignore"):
                value = self._likelihood(force, shown, x[ok])
            log_likelihood[ok] = np.where(np.isnan(value), -np.inf, value)
            if shown is not None:
                every = np.full((len(x), *shown.shape[1:]), np.nan)
                every[ok] = shown
        log_prior = np.where(inside, self.prior.log_density(x), -np.inf)
        return Evaluation(log_prior, log_likelihood, outcome_of(status, inside), every_force, every)

    def _solved(self, x: Array) -> tuple[Array, NDArray[np.int8], NDArray[np.bool_]]:
        """Forces (B, N) N and their status, and (B,) True where the convexity prior holds.

        Nobody has to look beyond the readings for a film that is convex whatever becomes of it.
        """
        n, sure = self.readings, self.prior.surely_inside(x)
        force, status, inside = np.empty((len(x), n)), np.empty((len(x), n), dtype=np.int8), sure.copy()
        mode = self.hypothesis.convexity
        for some, beyond in ((sure, False), (~sure, mode.looks_beyond)):
            if np.any(some):
                found = (self.nodes or self.forward)(x[some], reached=beyond, spare=mode.spare)
                force[some], status[some] = found.force, found.status
                if some is not sure:
                    inside[some] = self.prior.inside(found)
        return force, status, inside

    def log_prior(self, x: ArrayLike) -> Array:
        """ln p0(x) where the convexity prior holds, -inf elsewhere; (B,). Only what may miss it is solved."""
        x = np.atleast_2d(np.asarray(x, dtype=float))
        out, rest = self.prior.log_density(x), ~self.prior.surely_inside(x)
        if np.any(rest):
            out[rest] = self.evaluate(x[rest]).log_prior
        return out

    def log_likelihood(self, x: ArrayLike) -> Array:
        """ln p(y | x), (B,); -inf where the film has no curve, or is not followed since the prior rules it out."""
        return self.evaluate(x).log_likelihood

    def given(self, curves: Array, x: Array) -> Array:
        """(B,) ln p0(x) + ln p(y | x) if x (B, k) had the ``curves`` of an `Evaluation`: what an emulator asks."""
        return self.prior.log_density(x) + self.likelihood_given(curves, x)

    def likelihood_given(self, curves: Array, x: Array) -> Array:
        """ln p(y | x), (B,), of the same: of x nothing but the coordinates of the noise is looked at."""
        n = len(self.measurement)
        traces = curves[:, n:].reshape(len(curves), -1, n) if self.noise.traced else None
        return self._likelihood(curves[:, :n], traces, x)

    def along(self, axes: Array) -> Along | None:
        """`given` for curves in the span of orthonormal ``axes`` (R, N), which hold the measured one, too.

        None where the noise does not weigh all readings alike.
        """
        noise = self.noise.along(axes)
        return None if noise is None else Along(self, axes @ self.measurement.force, noise)

    def pointwise(self, x: Array, force: Array) -> Array:
        """ln p(y_i | other y, x) of draws x (B, k) with curves ``force`` (B, N), shape (B, N)."""
        residual, noise = self.measurement.force - force, self.noise_at(x, force)
        return noise.pointwise(residual, self.hypothesis.noise_coordinates(x))

    def noise_at(self, x: Array, force: Array) -> NoiseLikelihood:
        """The noise of draws x (B, k) with curves ``force`` (B, N) N, none of them nan."""
        return self.noise.at(force, self._traces(x, force))

    def _traces(self, x: Array, force: Array) -> Array | None:
        return traces(self.forward, x, force) if self.noise.traced else None

    def _likelihood(self, force: Array, shown: Array | None, x: Array) -> Array:
        noise = self.noise.at(force, shown)
        return noise.log_likelihood(self.measurement.force - force, self.hypothesis.noise_coordinates(x))


@dataclass(frozen=True, eq=False)
class Along:
    """A posterior asked with the coordinates of curves along R axes: ``force`` (R,) N are those of the measured one."""

    posterior: Posterior
    force: Array
    noise: NoiseLikelihood

    @property
    def curve_size(self) -> int:
        """As `Posterior.curve_size`."""
        return self.posterior.curve_size

    def given(self, curves: Array, x: Array) -> Array:
        """As `Posterior.given` of the curves with the coordinates ``curves`` (B, R)."""
        return self.posterior.prior.log_density(x) + self.likelihood_given(curves, x)

    def likelihood_given(self, curves: Array, x: Array) -> Array:
        """ln p(y | x), (B,), of the same, as `Posterior.likelihood_given`."""
        return self.noise.log_likelihood(self.force - curves, self.posterior.hypothesis.noise_coordinates(x))


def outcome_of(status: NDArray[np.int8], inside: NDArray[np.bool_]) -> NDArray[np.int8]:
    """(B,) from statuses (B, N): what physics or the prior rules out is no failure of the numbers."""
    outcome = np.where(inside, Outcome.OK, Outcome.NOT_CONVEX).astype(np.int8)
    bad = status != Status.OK
    if not np.any(bad):
        return outcome
    physical = np.isin(status, PHYSICAL)
    first = np.min(np.where(physical, status, np.iinfo(np.int8).max), axis=1)
    outcome = np.where(inside, np.max(status, axis=1), outcome)
    return np.where(np.any(physical, axis=1), first, outcome).astype(np.int8)


class Outcomes(Counter[str]):
    """How many draws met each outcome, by label; ``examples`` has the first (k,) coordinates that met one but `OK`."""

    def __init__(self, counts: Mapping[str, int] | None = None) -> None:
        super().__init__(counts or {})
        self.examples: dict[str, tuple[float, ...]] = dict(getattr(counts, "examples", {}))

    def note(self, x: Array, outcome: NDArray[np.int8]) -> None:
        """Count draws x (B, k) with their `Outcome` codes (B,)."""
        counts = np.bincount(outcome, minlength=len(Outcome))
        for o in Outcome:
            if not counts[o]:
                continue
            self[o.label] += int(counts[o])
            if o != Outcome.OK and o.label not in self.examples:
                self.examples[o.label] = tuple(map(float, x[int(np.argmax(outcome == o))]))


def fixed_by_data(hypothesis: Hypothesis) -> int:
    """How many parameters only data fix: the material's, and sizes of effects; priors hold their shapes."""
    return hypothesis.material_size + sum(len(e.sizes) for e in hypothesis.effects)


def enough_points(hypothesis: Hypothesis, measurement: Measurement, priors: bool = True) -> None:
    """Raise `SettingsError` if the curve has more parameters than the measurement has points: those `fixed_by_data`,
    or without ``priors`` all.
    """
    count = fixed_by_data(hypothesis) if priors else hypothesis.curve_size
    if len(measurement) < count:
        raise SettingsError(
            f"{len(measurement)} points cannot fix the {count} parameters of {hypothesis.label()}",
            remedy=f"use a longer range or a simpler material{' or fewer effects' if hypothesis.effects else ''}",
        )
