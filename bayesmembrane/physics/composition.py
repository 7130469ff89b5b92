"""Film and effects together: each stage in turn, and the frame's compliance closed around them.

Nothing here knows a particular effect. See `effects.base` for the stages and their order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.effects.base import (
    Carried,
    Compliance,
    Deflection,
    Effect,
    FilmState,
    Geometry,
    Memory,
    Sensor,
    Slack,
    ordered,
)
from bayesmembrane.physics.frame import in_series
from bayesmembrane.physics.mechanics.solution import Status
from bayesmembrane.physics.shared import Shared, Varied, parted

Law = Any
"""(deflection (B, N), excess (B, N) or None) -> (force (B, N), slope (B, N)), and ``status`` (B,) where it is nan."""

# Steps of differences: in material coordinates, which are of order one, and relative to an effect's expected size; a
# film that is mounted differently is solved again, to a tenth of 1e-6.
MATERIAL_STEP, EFFECT_STEP, MOUNTING_STEP = 1e-6, 1e-5, 3e-3
REMEMBERED = (0.5, 10.0)
"""Least and most of the slope without memory that a film is taken to have: a force that relaxed to nothing still grows.
"""


@dataclass(frozen=True, eq=False)
class Composition:
    """The reading F(x) of a load cell over a film with effects, at all points of a path.

    effects : in any order
    path : how the disc was moved
    """

    effects: tuple[Effect, ...]
    path: Motion

    @cached_property
    def placed(self) -> list[tuple[Effect, slice]]:
        """Effects in the order in which they act, with their places in the vector of all effect parameters."""
        ends = np.cumsum([0, *(len(e.coordinates) for e in self.effects)])
        where = {e.name: slice(int(a), int(b)) for e, a, b in zip(self.effects, ends[:-1], ends[1:], strict=True)}
        return [(e, where[e.name]) for e in ordered(self.effects)]

    def _acting(self, stage: type[Any], x: Array) -> list[tuple[Any, Array]]:
        return [(e, e.within_bounds(x[:, at])) for e, at in self.placed if isinstance(e, stage)]

    @property
    def yields(self) -> bool:
        """True if there is a loop around the frame to close."""
        return any(isinstance(e, Compliance) for e in self.effects)

    @cached_property
    def taut(self) -> bool:
        """True if films may be taut on both sides of their plane."""
        return any(isinstance(e, Geometry) for e in self.effects)

    def prestretch(self, x: Array) -> Array:
        """(B,) pre-stretch of films with effect parameters x (B, k)."""
        out = np.ones(len(x))
        for effect, p in self._acting(Geometry, x):
            out = out * effect.prestretch(p)
        return out

    def given(self, x: Array, deflection: Array) -> Array:
        """(B, N) m: what is left of ``deflection`` (B, N) for the film."""
        for effect, p in self._acting(Deflection, x):
            deflection = (effect.deflect_taut if self.taut else effect.deflect)(p, deflection, self.path)
        return deflection

    def end(self, x: Array) -> Array:
        """(B,) m: the largest deflection that a film may see, on either side of rest if it is mounted taut."""
        given = self.given(x, self._measured(len(x)))
        return np.asarray(np.max(np.abs(given) if self.taut else given, axis=1))

    def __call__(self, law: Law, x: Array) -> tuple[Array, NDArray[np.int8]]:
        """(reading (B, N) N, status (B, N)) of films with effect parameters x (B, k)."""
        _, force, status = self.closed(law, x)
        return self.read(x, force, status)

    def read(self, x: Array, force: Array, status: NDArray[np.int8]) -> tuple[Array, NDArray[np.int8]]:
        """(reading (B, N) N, status (B, N)) of ``force`` (B, N) N, of which ``status`` (B,) says why it is nan."""
        for effect, p in self._acting(Sensor, x):
            force = effect.read(p, force, self.path)
        each = np.where(np.isfinite(force), Status.OK, status[:, None]).astype(np.int8)
        return np.where(each == Status.OK, force, np.nan), each

    def closed(self, law: Law, x: Array, start: Array | None = None) -> tuple[Array, Array, NDArray[np.int8]]:
        """((B, N) m, (B, N) N, (B,)): deflection and force of the film, with delta + u(F(delta)) = the measured
        deflection, from forces ``start`` (B, N) where they are known; and `Status` where the force is nan.
        """
        measured = self._measured(len(x))
        frame = self._acting(Compliance, x)
        if not frame:
            return measured, self.film(law, x, measured)[0], law.status

        def film(rows: NDArray[np.intp], delta: Array) -> tuple[Array, Array]:
            return self.film(law if rows.size == len(x) else law.of(rows), x[rows], delta)

        def yielding(rows: NDArray[np.intp], force: Array, peaks: Array) -> tuple[Array, Array]:
            parts = [e.yielding(p[rows], force, peaks) for e, p in frame]
            return sum(u for u, _ in parts), sum(du for _, du in parts)

        delta, force, found = in_series(film, yielding, measured, start)
        return delta, force, np.where(found, law.status, Status.ITERATION_LIMIT).astype(np.int8)

    def film(self, law: Law, x: Array, delta: Array) -> tuple[Array, Array]:
        """((B, N) N, (B, N) N/m): force of the film whose edge is at ``delta`` (B, N) m, and about its slope."""
        given = self.given(x, delta)
        excess = None
        for effect, p in self._acting(Slack, x):
            more = effect.excess(p, given, self.path)
            excess = more if excess is None else excess + more
        virgin, slope = law(given, excess)
        force, state = virgin, FilmState(self.path, given, virgin, slope)
        for effect, p in self._acting(Carried, x):
            force = effect.carried(p, force, state)
        for effect, p in self._acting(Memory, x):
            force = effect.remember(p, force, self.path)
        with np.errstate(all="ignore"):
            part = np.where(virgin != 0, np.clip(force / virgin, *REMEMBERED), 0.0)
        return force, slope * part

    def _measured(self, rows: int) -> Array:
        return np.broadcast_to(self.path.deflection, (rows, self.path.deflection.size))


def mountings(composition: Composition, x: Array) -> list[Array]:
    """Points (B, k) whose films are mounted in another way than those at x (B, k): what `differences` needs laws of."""
    mounting = (isinstance(e, Geometry) for e in composition.effects for _ in e.coordinates)
    return [_moved(composition, x, i)[0] for i, other in enumerate(mounting) if other]


def _moved(composition: Composition, x: Array, number: int) -> tuple[Array, Array]:
    """x (B, k) with one coordinate moved for a difference, on the admissible side, and by how much (B,)."""
    effect, p = [(e, p) for e in composition.effects for p in e.coordinates][number]
    h = (MOUNTING_STEP if isinstance(effect, Geometry) else EFFECT_STEP) * p.scale
    step, moved = np.where(x[:, number] + h <= p.bounds[1], h, -h), x.copy()
    moved[:, number] += step
    return moved, step


def differences(
    composition: Composition, law: Law, mounted: Sequence[Law], x: Array, jacobian: Array
) -> tuple[Array, NDArray[np.int8], Array]:
    """(reading (B, N), status (B, N), d reading / d coordinates (B, N, m + k)).

    law : of the films, able to vary
    mounted : the laws at the `mountings` of x
    x : (B, k) effect parameters
    jacobian : (B, n, m) d (membrane parameters) / d (material coordinates)

    Differences on the admissible side, in one batch; a material coordinate varies the law to first order. What only the
    load cell adds needs no other film.
    """
    changes = [Varied(x, MATERIAL_STEP, law.varied(MATERIAL_STEP * rate)) for rate in np.moveaxis(jacobian, 2, 0)]
    others = iter(mounted)
    for i, effect in enumerate(e for e in composition.effects for _ in e.coordinates):
        moved, step = _moved(composition, x, i)
        changes.append(Varied(moved, step[:, None], next(others) if isinstance(effect, Geometry) else law, effect))
    if composition.yields:
        forces, why = _yielding(composition, law, x, changes)
    else:
        forces, why = Shared(composition.placed, composition.path, law, x, changes).forces(), law.status
    at = np.concatenate([x, *(c.x for c in changes)])
    reading, status = composition.read(at, np.concatenate(forces), np.tile(why, len(forces)))
    first, *rest = parted(reading, len(forces))
    slopes = [(r - first) / c.step for r, c in zip(rest, changes, strict=True)]
    return first, status[: len(x)], np.stack(slopes, axis=2)


def _yielding(
    composition: Composition, law: Law, x: Array, changes: Sequence[Varied]
) -> tuple[list[Array], NDArray[np.int8]]:
    """Forces (B, N) of films with effect parameters x (B, k), and of each change; and `Status` (B,) where they are nan.

    Each film lies elsewhere, so that nothing is shared but with what only the load cell adds. Beside one that does not
    close none is sought.
    """
    _, plain, why = composition.closed(law, x)
    moved = [c for c in changes if not isinstance(c.effect, Sensor)]
    closed = np.flatnonzero(np.any(np.isfinite(plain), axis=1))
    beside = np.full((len(moved), *plain.shape), np.nan)
    if closed.size:
        laws, points = [c.law.of(closed) for c in moved], np.concatenate([c.x[closed] for c in moved])
        near = np.tile(plain[closed], (len(laws), 1))
        beside[:, closed] = np.reshape(
            composition.closed(type(law).stack(laws), points, near)[1], (len(laws), closed.size, -1)
        )
    each = iter(beside)
    return [plain, *(plain if isinstance(c.effect, Sensor) else next(each) for c in changes)], why
