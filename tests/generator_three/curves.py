"""Force over deflection of one film, as cubic splines through states solved at once: F(d), odd in d, mm and N.

The largest deflection of the test is that at which the film is stretched as much as was asked for, somewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from tests.generator_three.elements import ElementFilm, NoBalanceError, Rubber

FIRST, STEP, LEAST_STEP = 0.3, 0.06, 0.004  # of the free length
BEYOND, TRACED = 1.12, 90
KNOTS, REACH, CLOSER = 42, 1.1, 1.3
SLIPPED = 0.002  # of the outer radius: enough for a difference, little enough to be a slope


@dataclass(frozen=True)
class _Traced:
    at: float
    most: float
    nodes: Any


@dataclass(frozen=True, eq=False)
class FilmCurves:
    """Curves of a film that is to be stretched by ``stretch`` at most. Raises `NoBalanceError` if it cannot be."""

    film: ElementFilm
    rubber: Rubber
    stretch: float
    _known: dict[Any, CubicSpline] = field(default_factory=dict, repr=False)

    @cached_property
    def _trace(self) -> list[_Traced]:
        """States at rising deflections until the film is stretched enough and some more."""
        free = self.film.outer - self.film.inner
        at, step, states = FIRST * free, STEP * free, []
        while True:
            start = self.film.scaled(states[-1].nodes, at / states[-1].at)[None] if states else None
            try:
                found = self.film.solve([at], self.rubber, start)
            except NoBalanceError:
                step /= 2
                if not states or step < LEAST_STEP * free:
                    raise
                at = states[-1].at + step
                continue
            states.append(_Traced(at, found.most[0], found.nodes[0]))
            if states[0].most > self.stretch:
                raise NoBalanceError("the film is stretched too much at the first deflection")
            if states[-1].most > self.stretch + 0.02 and at > BEYOND * self._where(states):
                return states
            if len(states) > TRACED:
                raise NoBalanceError("the film is never stretched so much")
            at = at + step

    def _where(self, states: Sequence[_Traced]) -> float:
        return float(np.interp(self.stretch, [s.most for s in states], [s.at for s in states]))

    @cached_property
    def peak(self) -> float:
        """mm, largest deflection of the test."""
        return self._where(self._trace)

    @cached_property
    def grid(self) -> Any:
        """(KNOTS,) mm, up to somewhat more than the peak."""
        return REACH * self.peak * (np.arange(1, KNOTS + 1) / KNOTS) ** CLOSER

    @cached_property
    def _nodes(self) -> Any:
        at = np.array([s.at for s in self._trace])
        nearest = [self._trace[int(np.argmin(abs(at - d)))] for d in self.grid]
        guess = [self.film.scaled(s.nodes, d / s.at) for s, d in zip(nearest, self.grid, strict=True)]
        return self.film.solve(self.grid, self.rubber, np.array(guess)).nodes

    def prepare(self) -> None:
        """Solve what all curves begin with. Raises `NoBalanceError`."""
        _ = self._nodes

    def curve(self, parameters: Sequence[float], stretch: float = 1.0, longer: float = 0.0) -> CubicSpline:
        """N over mm for other parameters, stretched before it was clamped, or longer by so much (mm)."""
        key = (tuple(parameters), round(stretch, 9), longer)
        if key not in self._known:
            rubber = replace(self.rubber, parameters=key[0], stretch=stretch, longer=longer)
            force = self.film.solve(self.grid, rubber, self._nodes).force
            at = np.concatenate([-self.grid[::-1], [0], self.grid])
            self._known[key] = CubicSpline(at, np.concatenate([-force[::-1], [0], force]))
        return self._known[key]

    @property
    def sound(self) -> CubicSpline:
        """N over mm, without any fault."""
        return self.curve(self.rubber.parameters)

    def by_length(self, parameters: Sequence[float], stretch: float) -> CubicSpline:
        """N/mm over mm: change of the force by the length of the film."""
        little = SLIPPED * self.film.outer
        plain, shorter = self.curve(parameters, stretch), self.curve(parameters, stretch, -little)
        return CubicSpline(plain.x, (plain(plain.x) - shorter(plain.x)) / little)

    def interpolation_error(self, stretch: float = 1.0) -> float:
        """N, the most by which the spline misses a state solved between two of its knots."""
        between = np.array([(a + b) / 2 for a, b in pairwise(self.grid)])
        rubber = replace(self.rubber, stretch=stretch)
        exact = self.film.solve(between, rubber, (self._nodes[1:] + self._nodes[:-1]) / 2).force
        return float(abs(exact - self.curve(rubber.parameters, stretch)(between)).max())


@dataclass(frozen=True)
class SoundFilm:
    """The film without faults, SI."""

    curves: FilmCurves

    @property
    def inner(self) -> float:
        """m"""
        return 1e-3 * self.curves.film.inner

    @property
    def outer(self) -> float:
        """m"""
        return 1e-3 * self.curves.film.outer

    def force(self, deflection: Any) -> Any:
        """(N,) N at deflections (N,) m."""
        return self.curves.sound(1e3 * np.asarray(deflection))
