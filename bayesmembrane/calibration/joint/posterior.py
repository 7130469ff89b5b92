"""ln p(x | all tests) + const: one prior, and the likelihoods of the tests added up."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayesmembrane.calibration.joint.claim import Joint
from bayesmembrane.calibration.posterior import Evaluation, Outcome, Posterior
from bayesmembrane.calibration.prior import SCRAMBLES, JointPrior, Scrambled
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.sobol import scrambled_sobol
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics import api


class SharedPrior(JointPrior):
    """p0(x) = prod_i p_i(x_i) over the coordinates of a `Joint`: the material's once, and those of every test."""

    def scrambled(self, seed: int) -> list[Scrambled]:
        joint = cast(Joint, self.hypothesis)
        own = zlib.crc32(f"{joint.label()} {' '.join(joint.labels)} {joint.convexity}".encode())
        rngs = np.random.default_rng([seed, own]).spawn(SCRAMBLES)
        return [Scrambled(self, scrambled_sobol(len(joint.parameters), rng)) for rng in rngs]


@dataclass(frozen=True, eq=False)
class JointPosterior:
    """p(x | y_1, y_2, ...) ~ p0(x) 1[convex in every test] prod_m N(y_m - F_m(x); 0, Sigma_m(x)).

    Residuals are weighed by the noise and the form error of their own test, and by nothing else. With one test it is
    that test's `Posterior`. It offers what walks, resumption and evidence ask of a posterior. Raises what `Posterior`
    raises for any of the tests.
    """

    joint: Joint
    solve: Solve = api.solve

    def __post_init__(self) -> None:
        self.parts  # noqa: B018 - what a test lacks is said at once

    @cached_property
    def parts(self) -> tuple[Posterior, ...]:
        """The posterior of each test alone."""
        return tuple(Posterior(p.hypothesis, p.measurement, self.solve) for p in self.joint.parts)

    @cached_property
    def prior(self) -> SharedPrior:
        return SharedPrior(cast(Hypothesis, self.joint))

    @property
    def with_weaker_convexity(self) -> JointPosterior | None:
        """The same with the next weaker convexity prior; None if its own asks nothing."""
        mode = self.joint.convexity.weaker
        if mode is None:
            return None
        parts = [replace(p, hypothesis=replace(p.hypothesis, convexity=mode)) for p in self.joint.parts]
        return replace(self, joint=replace(self.joint, parts=tuple(parts)))

    @property
    def size(self) -> int:
        """K, the number of coordinates."""
        return len(self.joint.parameters)

    @property
    def readings(self) -> int:
        """Of all tests."""
        return sum(len(p.measurement) for p in self.parts)

    def evaluate(self, x: ArrayLike) -> Evaluation:
        """Prior, likelihood, curves and outcome of x (B, K); the curves of all tests stand side by side in ``force``.

        Tests whose forces cost next to nothing come first: what they rule out is not solved in the others.
        """
        x = np.atleast_2d(np.asarray(x, dtype=float))
        log_likelihood, inside = np.zeros(len(x)), np.ones(len(x), bool)
        outcome = np.full(len(x), Outcome.OK, dtype=np.int8)
        curves = [np.full((len(x), width), np.nan) for width in self._widths]
        for i in self._cheap_first:
            rows = np.flatnonzero(inside)
            if not rows.size:
                break
            found = self.parts[i].evaluate(self.joint.of(i, x[rows]))
            shown = found.curves
            curves[i][rows, : shown.shape[1]] = shown
            log_likelihood[rows] += found.log_likelihood
            outcome[rows] = np.where(outcome[rows] == Outcome.OK, found.outcome, outcome[rows])
            inside[rows] = np.isfinite(found.log_prior)
        log_prior = np.where(inside, self.prior.log_density(x), -np.inf)
        log_likelihood = np.where(inside, log_likelihood, -np.inf)
        return Evaluation(log_prior, log_likelihood, outcome, np.concatenate(curves, axis=1))

    def log_prior(self, x: ArrayLike) -> Array:
        """ln p0(x) where the convexity prior holds in every test, -inf elsewhere; (B,)."""
        return self.evaluate(x).log_prior

    def log_likelihood(self, x: ArrayLike) -> Array:
        """ln p(y_1, y_2, ... | x), (B,)."""
        return self.evaluate(x).log_likelihood

    def given(self, curves: Array, x: Array) -> Array:
        """(B,) ln p0(x) + ln p(y | x) if x (B, K) had the ``curves`` of an `Evaluation`: what an emulator asks."""
        total = self.prior.log_density(x)
        ends = np.cumsum(self._widths)[:-1]
        for i, own in enumerate(np.split(curves, ends, axis=1)):
            part, at = self.parts[i], self.joint.of(i, x)
            total = total + part.given(own, at) - part.prior.log_density(at)
        return np.asarray(total)

    def inside(self, x: Array) -> NDArray[np.bool_]:
        """(B,) True where the convexity prior holds in every test."""
        return self.log_prior(x) > -np.inf

    @cached_property
    def _cheap_first(self) -> list[int]:
        return sorted(range(len(self.parts)), key=lambda i: not self.parts[i].forward.rig.closed_form)

    @cached_property
    def _widths(self) -> list[int]:
        """Columns of each test in `Evaluation.curves`: readings, and traces of effects where noise asks for them."""
        traced = [len(p.hypothesis.effects) if p.noise.traced else 0 for p in self.parts]
        return [len(p.measurement) * (1 + n) for p, n in zip(self.parts, traced, strict=True)]
