"""A cheap density close to the posterior, on which proposals walk far; the posterior itself judges where they end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from bayesmembrane.calibration.posterior import Evaluates, Given, Posterior, solved_in_parts
from bayesmembrane.calibration.sampling.proposals.polynomials import monomials, terms_of
from bayesmembrane.calibration.sampling.proposals.scored import Scored, ScoredAlong
from bayesmembrane.ground.parameters import Array

LEARN_FROM, LEARN_FORCES, LEAST_DRAWS, HELD_OUT = 4000, 6_000_000, 60, 0.25
DEGREES = (1, 2, 3, 4)
PER_TERM = 4  # draws for each coefficient of a polynomial
RIDGE = 1e-8
DOUBT = 0.02  # weight of the wide density for what the draws have not seen
TAIL, WIDE = 4.0, 2.0  # its degrees of freedom, and its spread relative to the draws
NEAR = 3.0  # standard deviations of the draws, in every direction, within which it is looked up where the prior is cut
CUT = 0.1  # part of the points there that must be cut away to make that worth its time
INNER = 100  # steps of a walk on the emulator
FAR = 0.1  # part of them that jump the whole difference between two draws
ROUND_OFF = 1e-6  # of ln q: less than what would be accepted by more than this is surely refused
SHORT, FAINT = 0.5, 1e-8  # axes that must do for so many readings, and directions of curves that are left out


class Emulated(Given, Evaluates, Protocol):
    """What a posterior must offer to be emulated."""


@dataclass(frozen=True, eq=False)
class Allowed:
    """Where points were found possible and where not: a prior that is cut is not emulated, but looked up.

    x : (M, k) points; possible : (M,)
    """

    x: Array
    possible: NDArray[np.bool_]

    @classmethod
    def of(cls, x: Array, possible: NDArray[np.bool_]) -> Allowed | None:
        """What was seen; None if all of it is possible."""
        return None if np.all(possible) else cls(x, possible)

    def near(self, centre: Array, inverse: Array) -> Lookup | None:
        """Of the points near the centre; None if nearly all of those are possible."""
        z = (self.x - centre) @ inverse.T
        close = np.sum(z * z, axis=1) < NEAR**2 * z.shape[1]
        if not np.any(close) or np.mean(self.possible[close]) > 1 - CUT:
            return None
        return Lookup(KDTree(z[close]), self.possible[close])


@dataclass(frozen=True, eq=False)
class Lookup:
    """Whether the nearest of some points is possible."""

    tree: KDTree
    possible: NDArray[np.bool_]

    def __call__(self, z: Array) -> NDArray[np.bool_]:
        """(B,) of whitened z (B, k)."""
        return np.asarray(self.possible[self.tree.query(z, eps=0.3)[1]])


@dataclass(frozen=True, eq=False)
class Emulator:
    """ln q(x) = ln [(1 - e) p(x | F^(x)) + e t(x)], with F^ polynomial in x and t wide; not normalised.

    posterior : turns curves into densities
    centre, root, inverse : x = centre + root z whitens the draws
    terms : (T, degree) indices of the factors of each monomial; k stands for a factor one
    coefficients : (T, N) F^ = monomials(z) coefficients, of all curves that the likelihood is made of, or (T, R) of
        their coordinates along a few axes
    level : ln of the height that the wide density is given at the centre
    archive : (M, k) draws whose differences are steps
    lookup : tells of whitened points whether the prior is cut there; None where it is not
    """

    posterior: Given
    centre: Array
    root: Array
    inverse: Array
    terms: NDArray[np.intp]
    coefficients: Array
    level: float
    archive: Array
    lookup: Lookup | None = None

    def log_density(self, x: Array, least: Array | float = -np.inf) -> Array:
        """ln q of x (B, k), shape (B,); what is less than ``least`` (B,) may be any value that is less, too."""
        z = (x - self.centre) @ self.inverse.T
        with np.errstate(all="ignore"):
            near = self.posterior.given(monomials(z, self.terms) @ self.coefficients, x)
        wide = self.level + _log_t(z)
        if self.lookup is not None:
            # Looking up takes longer than all else, and matters only where the wide density is not more anyway, and
            # where the sum may be enough.
            some = np.flatnonzero((near > wide) & (np.logaddexp(near, wide) >= least))
            near[some[~self.lookup(z[some])]] = -np.inf
        return np.asarray(np.logaddexp(np.where(np.isnan(near), -np.inf, near), wide))

    def walk(self, x: Array, rng: np.random.Generator, steps: int = INNER) -> tuple[Array, Array]:
        """(y, ln q(x) - ln q(y)) after ``steps`` Metropolis steps on q from x (B, k).

        The steps x + g (a - b) with a, b from the archive are symmetric, and so the whole walk satisfies detailed
        balance with respect to q: as a proposal for the posterior it has the factor q(x) / q(y) (J. S. Liu, Monte Carlo
        Strategies in Scientific Computing, 2001, section 5.4.4, the surrogate transition method).
        """
        n, k = x.shape
        start = now = self.log_density(x)
        for _ in range(steps):
            a, b = self.archive[rng.integers(len(self.archive), size=(2, n))]
            scale = np.where(rng.random((n, 1)) < FAR, 1.0, 2.38 / np.sqrt(2 * k) * rng.gamma(4.0, 0.25, (n, 1)))
            y = x + scale * (a - b)
            chance = np.log(rng.random(n))
            there = self.log_density(y, now + chance - ROUND_OFF)
            accept = chance < there - now
            x, now = np.where(accept[:, None], y, x), np.where(accept, there, now)
        return x, start - now


@dataclass(frozen=True, eq=False)
class Solved:
    """ln p (M,) and the curves (M, N) of points, as an `Evaluation` has them."""

    log_posterior: Array
    curves: Array


def emulate(
    posterior: Emulated,
    x: Array,
    rng: np.random.Generator,
    seen: Allowed | None = None,
    solved: Solved | None = None,
) -> Emulator | None:
    """An emulator learned from draws x (M, k), of the polynomial degree that predicts held-out densities best.

    ``seen`` tells where the prior is cut; without it the cut is left to whoever judges. What is ``solved`` of the draws
    is not solved again. None where there are too few possible draws to learn from.
    """
    x, first = np.unique(x, axis=0, return_index=True)
    some = rng.permutation(len(x))[: min(LEARN_FROM, max(LEARN_FORCES // posterior.readings, 4 * LEAST_DRAWS))]
    x = x[some]
    if solved is None:
        truth, curves = solved_in_parts(posterior, x)
    else:
        curves, truth = solved.curves[first[some]], solved.log_posterior[first[some]]
    ok = np.isfinite(truth) & np.all(np.isfinite(curves), axis=1)
    x, curves, truth = x[ok], curves[ok], truth[ok]
    if len(x) < LEAST_DRAWS:
        return None
    centre, root = np.mean(x, axis=0), _root(x)
    inverse: Array = np.asarray(np.linalg.inv(root), dtype=float)
    z = (x - centre) @ inverse.T
    terms, coefficients = _best(z, curves, lambda f, held: _misfit(posterior.given(f, x[held]), truth[held]))
    given, shorter = _shortened(posterior, coefficients)
    lookup = None if seen is None else seen.near(centre, inverse)
    emulator = Emulator(given, centre, root, inverse, terms, shorter, -np.inf, x, lookup)
    level = float(np.median(emulator.log_density(x) - _log_t(z)) + np.log(DOUBT))
    return replace(emulator, level=level)


def _shortened(posterior: Emulated, coefficients: Array) -> tuple[Given, Array]:
    """A posterior asked along the few axes that its curves span, and the coefficients there: of long curves a part.

    All curves are sums of T; where noise weighs every reading alike, nothing but their T + 1 products with each other
    and with the data counts, however many readings there are.
    """
    own = posterior.posterior if isinstance(posterior, Scored) else posterior
    if not isinstance(own, Posterior) or own.noise.traced:  # traces stand behind the forces
        return posterior, coefficients
    _, size, axes = np.linalg.svd(np.vstack([coefficients, own.measured]), full_matrices=False)
    axes = axes[size > FAINT * size[0]]
    along = own.along(axes) if len(axes) <= SHORT * coefficients.shape[1] else None
    if along is None:
        return posterior, coefficients
    short = ScoredAlong(along, posterior.scores) if isinstance(posterior, Scored) else along
    return short, coefficients @ axes.T


def _best(z: Array, force: Array, score: Callable[[Array, NDArray[np.bool_]], float]) -> tuple[NDArray[np.intp], Array]:
    """Terms and coefficients of the degree whose held-out misfit is least, fitted to all draws."""
    held = np.arange(len(z)) < HELD_OUT * len(z)
    choices = []
    for degree in DEGREES:
        terms = terms_of(z.shape[1], degree)
        if degree > 1 and PER_TERM * len(terms) > np.count_nonzero(~held):
            break
        fit = _fitted(monomials(z[~held], terms), force[~held])
        choices.append((score(monomials(z[held], terms) @ fit, held), degree))
    terms = terms_of(z.shape[1], min(choices)[1])
    return terms, _fitted(monomials(z, terms), force)


def _misfit(emulated: Array, truth: Array) -> float:
    """Mean absolute error of ln p, each cut at 5: a few wild draws do not choose the degree."""
    return float(np.mean(np.minimum(np.nan_to_num(np.abs(emulated - truth), nan=5.0), 5.0)))


def _fitted(a: Array, force: Array) -> Array:
    gram = a.T @ a
    gram[np.diag_indices_from(gram)] += RIDGE * np.trace(gram) / len(gram)
    return np.asarray(np.linalg.solve(gram, a.T @ force))


def _root(x: Array) -> Array:
    """Lower triangular R with R R^T the covariance of x (M, k)."""
    covariance = np.atleast_2d(np.cov(x.T))
    covariance[np.diag_indices_from(covariance)] *= 1 + 1e-10
    return np.asarray(np.linalg.cholesky(covariance))


def _log_t(z: Array) -> Array:
    """ln of the wide t-density at whitened z (B, k), relative to its centre."""
    return np.asarray(-0.5 * (TAIL + z.shape[1]) * np.log1p(np.sum((z / WIDE) ** 2, axis=1) / TAIL))
