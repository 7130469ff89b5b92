"""A load cell, or an amplifier behind it, that yields before its limit, beside a film that is fitted through it.

    reading = F (1 + (F / L)^p)^(-1/p)

of the film's force F, with the limit L and the sharpness p; p towards infinity is a limit that is met at once. It is
the saturation of an amplifier by C. Rapp, Proc. 2nd Eur. Conf. Satellite Communications (1991) 179.

A film that is fitted without it has been bent to follow it, and an energy may be preferred for that alone. So film,
limit and sharpness are looked for together, by Gauss and Newton's steps, from films that are fitted to the lower
readings.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.evidence import Block, Linear, weighed
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.candidates.standard import standard
from bayesmembrane.diagnosis.thresholds import SATURATION
from bayesmembrane.ground.parameters import Array


@dataclass(frozen=True)
class Saturation:
    """The law of the reading. limit : L, N; sharpness : p."""

    limit: float
    sharpness: float

    def _power(self, force: Array) -> Array:
        """(N,) p ln(F / L); far below zero where a film pushes or carries nothing."""
        return self.sharpness * np.log(np.maximum(force, 1e-12 * self.limit) / self.limit)

    def reading(self, force: Array) -> Array:
        """(N,) N of forces F (N,) N; those that push are not limited."""
        limited = self.limit * np.exp(-np.logaddexp(0.0, -self._power(force)) / self.sharpness)
        return np.where(force > 0, limited, force)

    def slope(self, force: Array) -> Array:
        """(N,) d (reading) / dF."""
        slope = np.exp(-(1 + 1 / self.sharpness) * np.logaddexp(0.0, self._power(force)))
        return np.where(force > 0, slope, 1.0)

    def by_limit(self, force: Array) -> Array:
        """(N,) N, d (reading) / d ln L, for the reading is of degree one in F and L."""
        return self.reading(force) - force * self.slope(force)

    def by_width(self, force: Array) -> Array:
        """(N,) N, d (reading) / d ln(1 / p)."""
        x = self._power(force)
        change = (np.logaddexp(0.0, -x) + x * expit(-x)) / self.sharpness
        return np.where(force > 0, -self.reading(force) * change, 0.0)


@dataclass(frozen=True, eq=False)
class Saturated:
    """A film behind a load cell that yields.

    law : of the reading
    film : without it
    log_evidence : of both, up to what all hypotheses under one noise share
    reading : (N,) N, what the load cell shows
    reached : (N,) True where the film alone would show the limit or more
    """

    law: Saturation
    film: Candidate
    log_evidence: float
    reading: Array
    reached: NDArray[np.bool_]


def saturated(search: Search, base: Candidate, before: Saturated | None = None) -> Saturated | None:
    """The most probable film and limit; None where nothing looks like one.

    From films fitted to the lower readings, or from where one was found ``before``, under another noise.
    """
    if not promises(search, base):
        return None
    starts = _starts(search, base) if before is None else _again(search, before)
    found = [_settled(_Point(search, film, law)) for film, law in starts]
    return max(found, key=lambda s: s.log_evidence, default=None)


def promises(search: Search, base: Candidate) -> bool:
    """True if some limit near the largest reading, beside the fit without one, would take enough away."""
    m = search.measurement
    force, top = m.force - base.residual, float(np.max(m.force))
    if top <= 0:
        return False
    laws = [Saturation(part * top, p) for part in SATURATION.tried for p in SATURATION.sharpnesses]
    model = search.linear(base)
    white = search.noise.white(np.column_stack([law.reading(force) - force for law in laws]))
    # Beside noise and form error as they are expected: what is foreign has driven the fitted ones up.
    freed = model.freed(np.minimum(base.theta, model.priors[:, 0]), white)
    along, square = freed.T @ model.data, np.sum(white * freed, axis=0)
    return bool(np.any((along > 0) & (along**2 > SATURATION.promise * square)))


def _again(search: Search, before: Saturated) -> Iterator[tuple[Candidate, Saturation]]:
    film = search.unweighed(before.film.hypothesis, before.film.x)
    if film is not None:
        yield film, before.law


def _starts(search: Search, base: Candidate) -> Iterator[tuple[Candidate, Saturation]]:
    """Films that are fitted to the lower readings, each with a limit at the highest ones."""
    limit = float(np.mean(np.sort(search.measurement.force)[-SATURATION.highest :]))
    for share in SATURATION.lower:
        fitted = fitted_below(search, base, share)
        film = None if fitted is None else search.unweighed(base.hypothesis, fitted.film.x)
        if film is not None and limit > 0:
            yield film, Saturation(limit, SATURATION.sharpness)


class Below(NamedTuple):
    """A film that is fitted to the lower readings.

    film : of these readings
    squares : it leaves of them, in those of the noise
    """

    film: Candidate
    squares: float


def fitted_below(search: Search, base: Candidate, share: float) -> Below | None:
    """The film of ``base`` fitted to the readings up to that ``share`` of the largest one; None if they are too few."""
    m = search.measurement
    lower = m.force <= share * float(np.max(m.force))
    if np.count_nonzero(lower) < base.x.size + SATURATION.spare:
        return None
    part = m.select(lower)
    noise = search.noise.part(part, lower)
    film = Search(part, noise, search.seed, search.solve).fit(base.hypothesis, [base.x])
    return None if film is None else Below(film, float(np.sum(noise.white(film.residual) ** 2)))


@dataclass(frozen=True, eq=False)
class _Point:
    """A film and a law of the reading, and what the load cell shows nearby, to first order.

    Its coefficients c (k + 2,) are those of the film (`Search.linear`), ln L over the width of its prior, which is as
    high everywhere up to twice the largest force, and ln(1 / p) in standard deviations of its own.
    """

    search: Search
    film: Candidate
    law: Saturation

    @cached_property
    def force(self) -> Array:
        """(N,) N, of the film alone."""
        return self.search.measurement.force - self.film.residual

    @cached_property
    def sensed(self) -> Candidate:
        """The film as the load cell shows it. Its form error is in parts of the reading, as if the law had some."""
        slope = self.law.slope(self.force)
        residual = self.search.measurement.force - self.law.reading(self.force)
        return replace(
            self.film, residual=residual, slopes=slope[:, None] * self.film.slopes, traces=slope * self.film.traces
        )

    @cached_property
    def prior(self) -> Array:
        """(2,) widths of ln L and ln(1 / p)."""
        highest = 2 * float(np.max(self.search.measurement.force))
        return np.array([highest / (self.law.limit * np.sqrt(2 * np.pi)), SATURATION.ln_width[1]])

    @cached_property
    def coefficients(self) -> Array:
        """(k + 2,) here. That of ln L counts from here: its prior is flat."""
        width = (-np.log(self.law.sharpness) - SATURATION.ln_width[0]) / SATURATION.ln_width[1]
        return np.concatenate([self.search.coefficients_at(self.film), [0.0, width]])

    @cached_property
    def model(self) -> Linear:
        white = self.search.noise.white(
            np.column_stack([self.law.by_limit(self.force), self.law.by_width(self.force)]) * self.prior
        )
        linear = self.search.linear(self.sensed)
        data = linear.data + white @ self.coefficients[-2:]
        return replace(linear, data=data, blocks=(Block(white), *linear.blocks))

    def density(self, theta: Array) -> float:
        """ln p(readings, c) here, for sizes of noise and form error, up to a constant."""
        forms = Linear(self.search.noise.white(self.sensed.residual), self.model.blocks[2:], self.model.ln_scale_sd)
        return forms.log_density(theta).value - 0.5 * float(self.coefficients @ self.coefficients)

    def moved(self, c: Array) -> _Point | None:
        """The point of other coefficients (k + 2,); None where no film gets there."""
        axes = standard(self.film.hypothesis, self.search.measurement)
        u = c[:-2] * axes.local(axes.to_u(self.film.x))
        low, high = axes.bounds
        x = axes.to_x(np.clip(u, np.where(axes.one_sided, np.maximum(low, 0.0), low), high))
        film = self.search.unweighed(self.film.hypothesis, x)
        by_limit = float(np.clip(c[-2] * self.prior[0], -SATURATION.largest_step, SATURATION.largest_step))
        by_width = float(np.clip(c[-1], -SATURATION.farthest_width, SATURATION.farthest_width))
        ln_width = SATURATION.ln_width[0] + by_width * SATURATION.ln_width[1]
        law = Saturation(self.law.limit * float(np.exp(by_limit)), float(np.exp(-ln_width)))
        return None if film is None else _Point(self.search, film, law)


def _settled(point: _Point) -> Saturated:
    """Where Gauss and Newton's steps end, each shortened until it gains, and the evidence there."""
    theta = None
    for _ in range(SATURATION.steps):
        theta = weighed(point.model, theta).theta
        here = point.density(theta)
        following = _better(point, theta, here)
        if following is None:
            break
        point, there = following
        if there - here < SATURATION.tolerance:
            break
    found = weighed(point.model, theta).log_evidence
    return Saturated(point.law, point.film, found, point.law.reading(point.force), point.force >= point.law.limit)


def _better(point: _Point, theta: Array, here: float) -> tuple[_Point, float] | None:
    """The first point on the way to the most probable coefficients that is more probable than this one, whose ln p is
    ``here``, and its ln p.
    """
    k = point.film.x.size
    mean = point.model.mean(theta)
    goal = np.concatenate([mean[2 : k + 2], mean[:2]])  # the model has the law's columns first
    begin, way = point.coefficients, 1.0
    for _ in range(SATURATION.halvings):
        trial = point.moved(begin + way * (goal - begin))
        if trial is not None and (there := trial.density(theta)) > here:
            return trial, there
        way *= 0.5
    return None
