"""Films that differ in one coordinate: what a change does not reach is computed once for all of them.

Stages act one after the other (`effects.base`). A change of what a film carries leaves its deflection and its law as
they are, one of its energy the length that has slid out of the clamp, and so on: of the thirty films that the slopes of
three effects take, most stages see few.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.effects.base import Carried, Deflection, Effect, FilmState, Geometry, Memory, Slack

Law = Any
"""As in `physics.composition`."""
Placed = tuple[Effect, slice]
"""An effect, and where its parameters stand among those of all."""


@dataclass(frozen=True)
class Varied:
    """Another point x (B, k) for a difference, ``step`` away, a number or (B, 1), and the law of its films.

    effect : whose parameter is another one; None of a change of the energy
    """

    x: Array
    step: float | Array
    law: Law
    effect: Effect | None = None


@dataclass(frozen=True, eq=False)
class _Parts:
    """Distinct values, (B, N) each, and the ``number`` of that which each of R films has."""

    values: Sequence[Array]
    number: Sequence[int]

    def of(self, some: Sequence[int]) -> Array:
        """(len(some) B, N) of ``some`` of the films, one after the other."""
        return np.concatenate([self.values[self.number[i]] for i in some])


class Shared:
    """R films without a frame that yields, each of B points: those with effect parameters x (B, k), and ``changes``."""

    def __init__(self, placed: Sequence[Placed], path: Motion, law: Law, x: Array, changes: Sequence[Varied]) -> None:
        self.placed, self.path = placed, path
        self.laws, self.points = [law, *(c.law for c in changes)], [x, *(c.x for c in changes)]
        self.changed: list[Effect | None] = [None, *(c.effect for c in changes)]

    def forces(self) -> list[Array]:
        """(B, N) N of each film, nan where it has none; that of `Composition.film`, to the last digit."""
        given, excess = self._given(), None
        for effect, at in self._acting(Slack):
            more = self._acted(effect, at, effect.excess, given)
            excess = more if excess is None else _sum(excess, more)
        force, state = self._virgin(given, excess)
        for effect, at in self._acting(Carried):
            force = self._acted(effect, at, effect.carried, force, state)
        for effect, at in self._acting(Memory):
            force = self._acted(effect, at, effect.remember, force)
        return [force.values[n] for n in force.number]

    def _given(self) -> _Parts:
        """What is left of the measured deflection."""
        shape = len(self.points[0]), self.path.deflection.size
        given = _Parts([np.broadcast_to(self.path.deflection, shape)], [0] * len(self.laws))
        taut = any(isinstance(e, Geometry) for e, _ in self.placed)
        for effect, at in self._acting(Deflection):
            given = self._acted(effect, at, effect.deflect_taut if taut else effect.deflect, given)
        return given

    def _virgin(self, given: _Parts, excess: _Parts | None) -> tuple[_Parts, Callable[[Sequence[int]], FilmState]]:
        """Forces before what the film remembers acts on them, and the `FilmState` of some films there."""
        some, number = _distinct(_numbers(self.laws), given.number, (given if excess is None else excess).number)
        law = type(self.laws[0]).stack([self.laws[i] for i in some])
        found = law(given.of(some), None if excess is None else excess.of(some))
        force, slope = (_Parts(parted(values, len(some)), number) for values in found)
        return force, lambda some: FilmState(self.path, given.of(some), force.of(some), slope.of(some))

    def _acting(self, stage: type[Any]) -> Iterator[tuple[Any, slice]]:
        return ((e, at) for e, at in self.placed if isinstance(e, stage))

    def _acted(
        self,
        effect: Effect,
        at: slice,
        act: Callable[..., Array],
        before: _Parts,
        state: Callable[[Sequence[int]], FilmState] | None = None,
    ) -> _Parts:
        """``act``, the method of the effect's stage, on what was ``before``, with the film's ``state`` or the path."""
        some, number = _distinct(before.number, [i if e is effect else -1 for i, e in enumerate(self.changed)])
        p = effect.within_bounds(np.concatenate([self.points[i][:, at] for i in some]))
        values = act(p, before.of(some), self.path if state is None else state(some))
        return _Parts(parted(values, len(some)), number)


def parted(values: Array, count: int) -> list[Array]:
    """``values`` (count B, N) as ``count`` arrays (B, N), without the price of `np.split`."""
    return list(values.reshape(count, -1, values.shape[-1]))


def _sum(one: _Parts, other: _Parts) -> _Parts:
    some, number = _distinct(one.number, other.number)
    return _Parts(parted(one.of(some) + other.of(some), len(some)), number)


def _numbers(things: Sequence[object]) -> list[int]:
    """Of each the place of the first that is the same."""
    first: dict[int, int] = {}
    return [first.setdefault(id(thing), i) for i, thing in enumerate(things)]


def _distinct(*numbers: Sequence[int]) -> tuple[list[int], list[int]]:
    """(some, number): of films with the same in all ``numbers`` (R,) the first, and which of these each is like."""
    some, number, places = list[int](), list[int](), dict[tuple[int, ...], int]()
    for i, key in enumerate(zip(*numbers, strict=True)):
        if key not in places:
            places[key] = len(some)
            some.append(i)
        number.append(places[key])
    return some, number
