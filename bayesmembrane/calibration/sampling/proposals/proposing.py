"""What a mixture proposes, solved and weighed: all coordinates, or the shape of the curve and the rest given that."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.calibration.posterior import Evaluates, Posterior, weighed
from bayesmembrane.calibration.sampling.proposals.collapsed import Collapsed, collapsed
from bayesmembrane.calibration.sampling.proposals.conditional import GivenShape
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture
from bayesmembrane.calibration.sampling.proposals.scored import scores_of
from bayesmembrane.calibration.sampling.proposals.scores import Scores
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.forward import AT_ONCE


@dataclass(frozen=True, eq=False)
class Proposed:
    """Proposals x (B, k), ln p there, ln of p over the density that they are drawn from, and `Outcome` codes, (B,)."""

    x: Array
    log_posterior: Array
    log_weights: Array
    outcome: NDArray[np.int8]


class Proposing(Protocol):
    """Where proposals come from, whatever the place they are made for."""

    def drawn(self, rng: np.random.Generator, count: int) -> Array:
        """(count, m) numbers that make ``count`` proposals; nothing is solved for them."""

    def solved(self, numbers: Array) -> Proposed:
        """The proposals made of ``numbers`` (B, m)."""

    def log_weights(self, x: Array, log_posterior: Array) -> Array:
        """(B,) ln of p over the density of proposals at x (B, k), whose ln p (B,) are known."""

    def places(self, x: Array) -> Array:
        """(B, m) the coordinates of x (B, k) that the mixture is one of."""


@dataclass(frozen=True, eq=False)
class Whole:
    """z ~ g, the mixture, of the normal scores of x."""

    posterior: Evaluates
    mixture: Mixture

    def drawn(self, rng: np.random.Generator, count: int) -> Array:
        return self.mixture.draw(rng, count)

    def solved(self, numbers: Array) -> Proposed:
        x = self.scores.back(numbers)
        found = weighed(self.posterior, x)
        lp = found.log_posterior
        return Proposed(x, lp, self._weights(numbers, lp), found.outcome)

    def log_weights(self, x: Array, log_posterior: Array) -> Array:
        return self._weights(self.places(x), log_posterior)

    def places(self, x: Array) -> Array:
        return self.scores.of(x)

    @cached_property
    def scores(self) -> Scores:
        """Of the coordinates."""
        return scores_of(self.posterior).bent(self.mixture.bend)

    def _weights(self, z: Array, log_posterior: Array) -> Array:
        return np.asarray(log_posterior + self.scores.log_stretch(z) - self.mixture.log_density(z))


@dataclass(frozen=True, eq=False)
class ShapeFirst:
    """s ~ g, the mixture, of the shape of the curve, then (ln_gd, ln_sd) ~ q given the curve of that shape.

    The density of a proposal is g(s) |ds / dx| q(ln_gd, ln_sd | f(s)), known for any x once its curve is.
    """

    collapsed: Collapsed
    mixture: Mixture

    def drawn(self, rng: np.random.Generator, count: int) -> Array:
        shapes = self.mixture.draw(rng, count)
        return np.concatenate([shapes, rng.random((count, 2))], axis=1)

    def solved(self, numbers: Array) -> Proposed:
        parts = [self._solved(part) for part in _parts(numbers, self.collapsed.readings)]
        return Proposed(*(np.concatenate(values) for values in zip(*parts, strict=True)))

    def log_weights(self, x: Array, log_posterior: Array) -> Array:
        both = np.concatenate([x, log_posterior[:, None]], axis=1)
        return np.concatenate([self._weighed(part) for part in _parts(both, self.collapsed.readings)])

    def places(self, x: Array) -> Array:
        return self.collapsed.part(x)

    def _solved(self, numbers: Array) -> tuple[Array, Array, Array, NDArray[np.int8]]:
        shapes, u = numbers[:, :-2], numbers[:, -2:]
        e = self.collapsed.evaluate(shapes)
        ok, x = np.isfinite(e.log_prior), self.collapsed.whole(shapes)
        lp, weights = np.full(len(x), -np.inf), np.full(len(x), -np.inf)
        if np.any(ok):
            given = self.collapsed.residuals(e.force[ok]).given()
            x[ok, 0], x[ok, -1] = given.drawn(u[ok])
            lp[ok] = self.collapsed.posterior.given(np.exp(x[ok, :1]) * e.force[ok], x[ok])
            weights[ok] = self._weights(x[ok], lp[ok], given)
            self.collapsed.remember(x[ok], e.force[ok])
        return x, lp, weights, e.outcome

    def _weighed(self, both: Array) -> Array:
        x, lp = both[:, :-1], both[:, -1]
        force, new = self.collapsed.remembered(x)
        ok, weights = ~new, np.full(len(x), -np.inf)
        if np.any(new):
            e = self.collapsed.evaluate(self.places(x[new]))
            force[new], ok[new] = e.force, np.isfinite(e.log_prior)
        if np.any(ok):
            weights[ok] = self._weights(x[ok], lp[ok], self.collapsed.residuals(force[ok]).given())
        return weights

    def _weights(self, x: Array, log_posterior: Array, given: GivenShape) -> Array:
        shapes = self.places(x)
        density = self.mixture.log_density(shapes) - self.collapsed.scores.log_stretch(shapes)
        return np.asarray(log_posterior - density - given.log_density(x[:, 0], x[:, -1]))


def proposing(posterior: Posterior, mixture: Mixture) -> Proposing:
    """Where proposals of a ``mixture`` come from: it is one of all coordinates, or of those of the shape."""
    if mixture.means.shape[1] == posterior.size:
        return Whole(posterior, mixture)
    found = collapsed(posterior)
    assert found is not None
    return ShapeFirst(found.bent(mixture.bend), mixture)


def _parts(rows: Array, readings: int) -> list[Array]:
    """``rows`` (B, m), as many at a time as curves of them fit into memory."""
    many = max(1, AT_ONCE // readings)
    return [rows[i : i + many] for i in range(0, len(rows), many)]
