"""Film and effects together: each stage in turn, and the frame's compliance closed around them.

Nothing here knows a particular effect. See `effects.base` for the stages and their order.
"""

from __future__ import annotations

from collections.abc import Callable
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
from bayesmembrane.physics.mechanics.solution import Status

Law = Any
"""(deflection (B, N), excess (B, N) or None) -> (force (B, N), slope (B, N)), and ``status`` (B,) where it is nan."""

MOST_ITERATIONS = 40
CLOSED = 1e-11  # of the largest deflection: the loop around the frame ends there
SHORT, STEEP = 1e-7, 5.0  # a secant over a shorter step is round-off, a steeper one no slope
# Steps of differences: in material coordinates, which are of order one, and relative to an effect's expected size; a
# film that is mounted differently is solved again, to a tenth of 1e-6.
MATERIAL_STEP, EFFECT_STEP, MOUNTING_STEP = 1e-6, 1e-5, 3e-3
BACK = 0.9  # of its way to a deflection at which there is no force is what a film is tried at instead


@dataclass(frozen=True, eq=False)
class Composition:
    """The reading F(x) of a load cell over a film with effects, at all points of a path.

    effects : in any order
    path : how the disc was moved
    """

    effects: tuple[Effect, ...]
    path: Motion

    @cached_property
    def _places(self) -> list[tuple[Effect, slice]]:
        """Effects in the order in which they act, with their places in the vector of all effect parameters."""
        ends = np.cumsum([0, *(len(e.coordinates) for e in self.effects)])
        where = {e.name: slice(int(a), int(b)) for e, a, b in zip(self.effects, ends[:-1], ends[1:], strict=True)}
        return [(e, where[e.name]) for e in ordered(self.effects)]

    def _acting(self, stage: type[Any], x: Array) -> list[tuple[Any, Array]]:
        return [(e, e.within_bounds(x[:, at])) for e, at in self._places if isinstance(e, stage)]

    @cached_property
    def mounting(self) -> NDArray[np.bool_]:
        """(k,) True for the parameters that change the film as mounted: only these need another film law."""
        stages = [isinstance(e, Geometry) for e in self.effects for _ in e.coordinates]
        return np.array(stages, dtype=bool)

    @property
    def yields(self) -> bool:
        """True if there is a loop around the frame to close."""
        return any(isinstance(e, Compliance) for e in self.effects)

    def prestretch(self, x: Array) -> Array:
        """(B,) pre-stretch of films with effect parameters x (B, k)."""
        out = np.ones(len(x))
        for effect, p in self._acting(Geometry, x):
            out = out * effect.prestretch(p)
        return out

    def given(self, x: Array, deflection: Array) -> Array:
        """(B, N) m: what is left of ``deflection`` (B, N) for the film."""
        for effect, p in self._acting(Deflection, x):
            deflection = effect.deflect(p, deflection, self.path)
        return deflection

    def end(self, x: Array) -> Array:
        """(B,) m: the largest deflection that a film may see."""
        return np.asarray(np.max(self.given(x, self._measured(len(x))), axis=1))

    def __call__(self, law: Law, x: Array, start: Array | None = None) -> tuple[Array, NDArray[np.int8]]:
        """(reading (B, N) N, status (B, N)) of films with effect parameters x (B, k); ``start`` as in `closed`."""
        _, force = self.closed(law, x, start)
        for effect, p in self._acting(Sensor, x):
            force = effect.read(p, force, self.path)
        status = np.where(np.isfinite(force), Status.OK, law.status[:, None]).astype(np.int8)
        return np.where(status == Status.OK, force, np.nan), status

    def closed(self, law: Law, x: Array, start: Array | None = None) -> tuple[Array, Array]:
        """((B, N) m, (B, N) N): deflection and force of the film, with delta + u(F(delta)) = the measured deflection.

        Newton's method, at first with the slope of a film without memory, then with secants, from ``start`` (B, N) or
        from what is measured.
        """
        measured = self._measured(len(x))
        frame = self._acting(Compliance, x)
        delta = measured if start is None or not frame else start
        force, slope = self.film(law, x, delta)
        if not frame:
            return delta, force
        reach = max(float(np.max(np.abs(measured))), 1e-12)
        for _ in range(MOST_ITERATIONS):
            u, du = (np.sum(v, axis=0) for v in zip(*(e.yielding(p, force) for e, p in frame), strict=True))
            residual = delta + u - measured
            lost = ~np.isfinite(residual)
            if np.all(lost | (np.abs(residual) <= CLOSED * reach)):
                break
            step = np.where(lost, (BACK - 1) * delta, -residual / (1 + du * slope))
            delta, before = delta + step, force
            force, slope = self.film(law, x, delta)
            # The secant also sees what history adds to the slope.
            with np.errstate(all="ignore"):
                secant = (force - before) / step
            use = (np.abs(step) > SHORT * reach) & (secant > 0) & (secant < STEEP * slope)
            slope = np.where(use, secant, slope)
        return delta, force

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
            part = np.where(virgin > 0, np.clip(force / virgin, 0.0, 10.0), 0.0)
        return force, slope * part

    def _measured(self, rows: int) -> Array:
        return np.broadcast_to(self.path.deflection, (rows, self.path.deflection.size))


def differences(
    composition: Composition, law: Law, mounted: Callable[[Array], Law], x: Array, jacobian: Array
) -> tuple[Array, NDArray[np.int8], Array]:
    """(reading (B, N), status (B, N), d reading / d coordinates (B, N, m + k)).

    law : of the films, able to vary
    mounted : the law for other effect parameters (B, k)
    x : (B, k) effect parameters
    jacobian : (B, n, m) d (membrane parameters) / d (material coordinates)

    Differences on the admissible side, all in one batch; a material coordinate varies the law to first order.
    """
    laws, points, steps = [law], [x], [np.ones(len(x))]
    for i in range(jacobian.shape[2]):
        laws.append(law.varied(MATERIAL_STEP * jacobian[:, :, i]))
        points.append(x)
        steps.append(np.full(len(x), MATERIAL_STEP))
    parameters = [p for e in composition.effects for p in e.coordinates]
    for i, (p, mounting) in enumerate(zip(parameters, composition.mounting, strict=True)):
        h = (MOUNTING_STEP if mounting else EFFECT_STEP) * p.scale
        step = np.where(x[:, i] + h <= p.bounds[1], h, -h)
        moved = x.copy()
        moved[:, i] += step
        laws.append(mounted(moved) if mounting else law)
        points.append(moved)
        steps.append(step)
    start = None
    if composition.yields:
        start = np.tile(composition.closed(law, x)[0], (len(laws), 1))
    reading, status = composition(type(law).stack(laws), np.concatenate(points), start)
    reading = reading.reshape(len(steps), len(x), -1)
    slopes = (reading[1:] - reading[0]) / np.array(steps[1:]).reshape(-1, len(x), 1)
    return reading[0], status[: len(x)], np.moveaxis(slopes, 0, 2)
