"""What joint least squares minimises: the residuals of all tests, each in units of its own noise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bayesmembrane.calibration.descent import descend
from bayesmembrane.calibration.fit import MANY
from bayesmembrane.calibration.joint.claim import Joint
from bayesmembrane.calibration.objective import Objective, separated
from bayesmembrane.data.thinning import shortened
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.mechanics import api

BEFORE = 0.01  # of the largest force: the noise of a test that states none, before residuals tell it
FOLLOWED = 0.01  # of that, of the one test that is to be followed closely
LEAST = 1e-6  # the same, at least: no test fits exactly
KEPT, STARTED = 40, 12  # starts of each test that are looked at in all, and from which a descent begins
ITERATIONS, ROUNDS, SETTLED = 60, 30, 1e-5
"""Steps of a descent; how often noises are inferred anew; the change of ln(noise) that ends it."""


def with_fewer_readings(joint: Joint) -> Joint:
    """The same with no more readings of each test than valleys are looked for with; itself if there are no more."""
    few = tuple(replace(p, measurement=shortened(p.measurement, MANY)) for p in joint.parts)
    same = all(a.measurement is b.measurement for a, b in zip(few, joint.parts, strict=True))
    return joint if same else Joint(few)


@dataclass(frozen=True, eq=False)
class JointObjective:
    """r(x) = (r_1 / s_1, r_2 / s_2, ...) of curve coordinates x (B, K'): all of a `Joint` but the noise.

    r_m is whitened by the noise that test m states, and s_m is then 1; one that states none has its residual in N, and
    s_m is inferred (`settled`).
    """

    joint: Joint
    solve: Solve = api.solve

    @cached_property
    def parts(self) -> tuple[Objective, ...]:
        """The objective of each test alone, whitened where it states its noise."""
        tests = self.joint.parts
        return tuple(
            Objective(
                p.hypothesis, p.measurement, "euclidean" if p.measurement.force_sd is None else "weighted", self.solve
            )
            for p in tests
        )

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """(K',) each."""
        low, high = np.array([self.joint.parameters[i].bounds for i in self.joint.curve], dtype=float).T
        return low, high

    @cached_property
    def centre(self) -> Array:
        """Prior medians (K',)."""
        return np.array([float(self.joint.parameters[i].prior.quantile(0.5)) for i in self.joint.curve])

    @cached_property
    def spread(self) -> Array:
        """Prior standard deviations (K',)."""
        return np.array([self.joint.parameters[i].prior.mean_sd[1] for i in self.joint.curve])

    @cached_property
    def sizes(self) -> Array:
        """(P,) readings of each test."""
        return np.array([len(p.measurement) for p in self.joint.parts])

    @cached_property
    def first(self) -> Array:
        """(P,) noises to begin with: 1 where a test states its own, else N."""
        return np.array([1.0 if o.loss == "weighted" else BEFORE * self._largest(o) for o in self.parts])

    def batch(self, x: Array, noises: Array) -> tuple[Array, Array]:
        """r (B, N) and dr/dx (B, N, K') at x (B, K') with noises (P,); nan where there is no curve."""
        whole = np.zeros((len(x), len(self.joint.parameters)))
        whole[:, self.joint.curve] = x
        found, slopes = [], []
        for i, objective in enumerate(self.parts):
            k = objective.hypothesis.curve_size
            r, j = objective.batch(self.joint.of(i, whole)[:, :k])
            wide = np.zeros((*r.shape, x.shape[1]))
            wide[:, :, np.searchsorted(self.joint.curve, self.joint.places[i][:k])] = j
            found.append(r / noises[i])
            slopes.append(wide / noises[i])
        return np.concatenate(found, axis=1), np.concatenate(slopes, axis=1)

    def each(self, x: Array) -> list[Array]:
        """The residual (N_m,) of every test at one x (K',), in units of its stated noise, or in N."""
        r = self.batch(x[None, :], np.ones(len(self.parts)))[0][0]
        return np.split(r, np.cumsum(self.sizes)[:-1])

    def starts(self, rng: np.random.Generator) -> Array:
        """Where to search from (M, K'), the best first: starts of every test, in all the others.

        Raises `SettingsError` if none of them has a curve in every test.
        """
        found = []
        for i, objective in enumerate(self.parts):
            pool, _ = objective.pool(rng)
            x = np.tile(self.centre, (min(len(pool), KEPT), 1))
            k = objective.hypothesis.curve_size
            own = pool[: len(x)].copy()
            own[:, 0] -= np.log(self.joint.thicker(i))
            x[:, np.searchsorted(self.joint.curve, self.joint.places[i][:k])] = own
            found.append(x)
        every = self._contained(np.concatenate(found))
        size = np.linalg.norm(self.batch(every, self.first)[0], axis=1)
        if not np.any(np.isfinite(size)):
            raise SettingsError(
                f"no {self.joint.label()} film with admissible parameters reaches the end of every test",
                remedy="use shorter ranges or another material, and check units and thicknesses",
            )
        every = every[np.argsort(size, kind="stable")][: np.count_nonzero(np.isfinite(size))]
        return np.array(separated(every, self.spread, STARTED))

    def descended(self, start: Array, noises: Array, pull: bool = False) -> tuple[Array, Array]:
        """(x (M, K'), |r| (M,)) below every start; with ``pull`` the priors' centres and spreads are residuals, too."""

        def residuals(x: Array) -> tuple[Array, Array]:
            r, j = self.batch(x, noises)
            if not pull:
                return r, j
            k = x.shape[1]
            own = np.broadcast_to(np.diag(1 / self.spread), (len(x), k, k))
            return np.concatenate([r, (x - self.centre) / self.spread], axis=1), np.concatenate([j, own], axis=1)

        with np.errstate(over="ignore"):  # a promise of next to nothing, whose gain is cut anyway
            return descend(residuals, start, self.bounds, ITERATIONS)

    def settled(self, start: Array, pull: bool = False) -> tuple[Array, Array, Array]:
        """(x (M, K'), |r| (M,), noises (P,)): optima, the best first, with the noise that their best residual shows.

        A test that states no noise gets the root of |r_m|^2 / N_m, which maximises its likelihood, and the search goes
        on with it until neither changes. Such likelihoods have several maxima, at each of which another test is
        followed closely: it is begun with all noises alike, and with that of one test after the other much smaller.
        The one of the largest likelihood counts; the optima of the others stand behind it.
        """
        found = [self._settled(start, noises, pull) for noises in self._beginnings()]
        found.sort(key=lambda each: -self._log_likelihood(each[0][0], each[2]))
        best, size, noises = found[0]
        if len(found) == 1:
            return best, size, noises
        x = np.concatenate([best[:1], *(other[0][:1] for other in found[1:]), best[1:]])
        return x, np.concatenate([size[:1], *(other[1][:1] for other in found[1:]), size[1:]]), noises

    def _beginnings(self) -> list[Array]:
        """Noises (P,) to begin with."""
        inferred = [i for i, o in enumerate(self.parts) if o.loss != "weighted"]
        out = [self.first]
        for i in inferred if len(self.parts) > 1 else []:
            out.append(self.first.copy())
            out[-1][i] *= FOLLOWED
        return out

    def _log_likelihood(self, x: Array, noises: Array) -> float:
        """ln p(y | x, noises) + const of one x (K',)."""
        r = self.batch(x[None, :], noises)[0][0]
        return float(-0.5 * np.sum(r * r) - np.sum(self.sizes * np.log(noises)))

    def _settled(self, start: Array, noises: Array, pull: bool) -> tuple[Array, Array, Array]:
        """The maximum that is reached from noises (P,)."""
        x, size = self.descended(start, noises, pull)
        for _ in range(ROUNDS):
            x, size = self._in_order(x, size)
            before, noises = noises, self.inferred(x[0])
            if np.all(np.abs(np.log(noises / before)) < SETTLED):
                break
            x, size = self.descended(x, noises, pull)
        return *self._in_order(x, size), noises

    def _in_order(self, x: Array, size: Array) -> tuple[Array, Array]:
        """The optima x (M, K') that have a curve, by size (M,); raises `SettingsError` without any."""
        order = np.argsort(size, kind="stable")[: np.count_nonzero(np.isfinite(size))]
        if not order.size:
            raise SettingsError(
                f"no {self.joint.label()} film was found that has forces and slopes in every test",
                remedy="use shorter ranges or another material",
            )
        return x[order], size[order]

    def inferred(self, x: Array) -> Array:
        """(P,) the noises at one x (K',): 1 where a test states its own, else the root mean square residual in N."""
        found = self.first.copy()
        for i, (objective, r) in enumerate(zip(self.parts, self.each(x), strict=True)):
            if objective.loss != "weighted":
                found[i] = max(float(np.sqrt(np.mean(r * r))), LEAST * self._largest(objective))
        return found

    def _contained(self, x: Array) -> Array:
        """The starts x (M, K'), and for each the neo-Hookean film of the same modulus, if the energy contains it."""
        simple = [self.joint.material.neo_hookean(float(np.exp(row[0]))) for row in x]
        plain = [
            np.concatenate([s, row[self.joint.shared :]]) for s, row in zip(simple, x, strict=True) if s is not None
        ]
        return np.concatenate([x, np.array(plain).reshape(-1, x.shape[1])])

    @staticmethod
    def _largest(objective: Objective) -> float:
        return float(np.max(np.abs(objective.measurement.force)))
