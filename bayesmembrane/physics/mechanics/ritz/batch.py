"""Many films side by side, each through its own deflections on its own elements, in the lanes of one kernel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics.compiled import bind
from bayesmembrane.physics.mechanics.request import Request
from bayesmembrane.physics.mechanics.ritz import kernels
from bayesmembrane.physics.mechanics.ritz.elements import basis, graded, replaced, unknowns
from bayesmembrane.physics.mechanics.ritz.simd import LANES

# Elements x bubbles per element.
LEVELS = ((1, 6), (2, 6), (4, 7), (8, 8), (12, 8), (16, 8), (16, 8))
# A force is exact to 1e-6 while the next bubbles would release less than this part of F delta (measured: the error is
# at most a hundred times the gain, over draws from the priors of all materials), and the first integral is even.
GAIN_LIMIT = 2e-10
VARIATION_LIMIT = 5e-4
TOLERANCE = 1e-11
MOST_ITERATIONS = 40
LIMITS = (TOLERANCE, GAIN_LIMIT, VARIATION_LIMIT)
# Largest step of the continuation in asinh(d), and the first deflection reached from the flat film.
STRIDE = 0.8
FIRST = 0.4


@dataclass(frozen=True)
class Shapes:
    """Solutions at K states: unknowns (K, 2n) on elements with ends (K, E+1), and what each would gain (K, E)."""

    unknowns: Array
    ends: Array
    gains: Array
    bubbles: int

    @classmethod
    def from_trace(cls, trace: Array, ends: Array, level: int) -> Self:
        """Of what a run left behind, (K, 2n + E)."""
        size = unknowns(*LEVELS[level])
        return cls(trace[:, :size], ends, trace[:, size:], LEVELS[level][1])

    @classmethod
    def flat(cls, ratio: float, count: int, level: int) -> Self:
        """``count`` films that are not deflected, on `graded` elements."""
        elements, bubbles = LEVELS[level]
        ends = np.tile(graded(ratio, elements), (count, 1))
        return cls(np.zeros((count, unknowns(elements, bubbles))), ends, np.zeros((count, elements)), bubbles)

    def placed(self, d: Array, level: int) -> Self:
        """The same at scaled deflections d (K,) on elements of another level, placed where they are needed."""
        ends, moved = replaced(self.unknowns, self.ends, self.gains, d, self.bubbles, LEVELS[level])
        return type(self)(moved, ends, np.zeros((len(d), LEVELS[level][0])), LEVELS[level][1])

    def put(self, rows: Any, other: Shapes) -> None:
        """Overwrite some states."""
        self.unknowns[rows], self.ends[rows], self.gains[rows] = other.unknowns, other.ends, other.gains

    def of(self, rows: Any) -> Self:
        return replace(self, unknowns=self.unknowns[rows], ends=self.ends[rows], gains=self.gains[rows])

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """All of them, one after the other; they have as many elements and bubbles."""
        names, bubbles = ("unknowns", "ends", "gains"), parts[0].bubbles
        return cls(**{n: np.concatenate([getattr(p, n) for p in parts]) for n in names}, bubbles=bubbles)


@cache
def compiled(material: type[Material]) -> Any:
    """The kernels of one material."""
    return bind(kernels.KERNELS, material, FIELDS=(0.0,) * len(material.field_names()))


def path(start: Array, d: Array, stride: float) -> tuple[Array, NDArray[np.bool_]]:
    """From scaled deflections ``start`` (B,) through ascending d (B, N) in steps of ``stride`` in asinh(d) at most.

    Returns deflections (M, B), of which the first is the start, and a mask (M,) of those that were asked for. Each film
    takes steps of its own, whoever is beside it, and where others take more waits at the end of them.
    """
    x = np.arcsinh(np.concatenate([start[None], d.T]))
    gap = np.diff(x, axis=0)
    steps = np.maximum(np.ceil(gap / stride), 1).astype(int)
    most = np.max(steps, axis=1)
    home = np.repeat(np.arange(len(gap)), most)
    part = np.arange(home.size) - np.repeat(np.cumsum(most) - most, most) + 1
    done = np.minimum(part[:, None] / steps[home], 1.0)
    grid = np.where(done < 1, np.sinh(x[home] + gap[home] * done), d.T[home])
    return np.concatenate([start[None], grid]), np.append(False, part == most[home])


def follow(request: Request, d: Array, level: int, sensitivities: bool = False) -> tuple[Array, Array]:
    """Continue B films from the flat film through ascending scaled deflections d (B, N), on `graded` elements.

    Returns what `run` returns.
    """
    start = np.minimum(FIRST, d[:, 0])
    return run(
        request, path(start, d, STRIDE / 2**level), Shapes.flat(request.ratio, len(d), level), level, sensitivities
    )


def run(
    request: Request,
    way: tuple[Array, NDArray[np.bool_]],
    start: Shapes,
    level: int,
    sensitivities: bool = False,
    most: int = MOST_ITERATIONS,
) -> tuple[Array, Array]:
    """B films through deflections grid (M, B) of a ``way`` (grid, keep) from a start each.

    Returns results (B, rows, N) and traces (B, 2n + E, N) at those of the deflections with ``keep`` (M,), see
    `kernels.follow`.
    """
    grid, keep = way
    count, fields = grid.shape[1], request.parameters.shape[1]
    blocks, n = -(-count // LANES), int(np.count_nonzero(keep))
    pad = np.minimum(np.arange(blocks * LANES), count - 1)

    def blocked(rows: Array) -> Array:
        """(R, B) -> (blocks, R, LANES), the last film repeated."""
        return np.ascontiguousarray(rows[:, pad].reshape(len(rows), blocks, LANES).transpose(1, 0, 2))

    gd = np.broadcast_to(shear_modulus(request), (1, count))
    # Not whatever lay in memory: what is reckoned with cells that no film reaches must be the same every time.
    result = np.full((blocks, LANES, kernels.RESULTS + (fields if sensitivities else 0), n), np.nan)
    trace = np.full((blocks, LANES, start.unknowns.shape[1] + start.gains.shape[1], n), np.nan)
    given = (request.parameters.T, gd, request.prestretch[None], grid, start.unknowns.T, start.ends.T)
    rows, tables = (blocked(v) for v in given), basis(*LEVELS[level])
    compiled(request.material).follow(*rows, tables, (most, *LIMITS), keep, sensitivities, result, trace)
    padded = blocks * LANES
    return result.reshape(padded, *result.shape[2:])[:count], trace.reshape(padded, *trace.shape[2:])[:count]


def shear_modulus(request: Request) -> Array:
    """(B,) G d, N/m."""
    return np.asarray(request.material.shear_modulus(request.parameters.T), dtype=float)


def films(request: Request, rows: NDArray[np.intp]) -> Request:
    """The same films, without the deflections, as often as ``rows`` say."""
    return replace(request, parameters=request.parameters[rows], prestretch=request.prestretch[rows])
