"""LossProfile likelihoods: the least loss with one parameter, or two, held; and where a valley ends, or does not."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array
from bayesmembrane.valleys.surface import Surface

FAR = 3.0  # profiles are followed until the loss has risen by this many times the stated rise
FIRST = 0.2  # of the half width that a parabola has: the first step from the optimum
GROWTH, STEPS = 1.25, 70
RETRIES, SHORTER = 4, 0.2  # steps that lead to no film, and how much shorter the next one is
NODES = 31
ROUNDS, ROUNDS_AT_A_WALL = 30, 10  # of the search for an end; where there is no film beyond, a coarse one
FLAT = 0.02  # of the stated rise: a loss that changes by less over the last tenth of the way has a limit
LOWER = 1e-4  # relative: a loss lower by this is another optimum


class Ending(Enum):
    """How one side of a profile ends."""

    RISES = "the loss leaves the rise"
    NO_FILM = "no film reaches the data beyond"
    NOT_FOLLOWED = "not followed to the end"
    TENDS = "the loss tends to a limit"
    CHANGES = "the loss still changes where the search ends"


@dataclass(frozen=True)
class End:
    """Where a profile leaves the stated rise on one side.

    value : natural parameter there; where it is followed to no further if ``open``
    loss : N, there
    ending : how
    """

    value: float
    loss: float
    ending: Ending

    @property
    def open(self) -> bool:
        """Whether the loss is within the stated rise as far as the parameter is followed."""
        return self.ending not in (Ending.RISES, Ending.NO_FILM)

    @property
    def tends(self) -> bool | None:
        """Whether the loss has a limit there: it hardly changes any more; None unless that is known."""
        return {Ending.TENDS: True, Ending.CHANGES: False}.get(self.ending)


@dataclass(frozen=True, eq=False)
class LossProfile:
    """min over the others of the loss, with parameter ``index`` held.

    points : (M, k) z, ordered along the held parameter
    loss : (M,) N
    ends : low and high
    """

    index: int
    points: Array
    loss: Array
    ends: tuple[End, End]


@dataclass(frozen=True, eq=False)
class PairMap:
    """min over the others of the loss (A, B), N, with parameters ``pair`` held at z ``first`` (A,), ``second`` (B,).

    inf where no film was found: the films there do not reach the data, or the order of the parameters forbids them.
    """

    pair: tuple[int, int]
    first: Array
    second: Array
    loss: Array


def optimum(surface: Surface, z: Array) -> tuple[Array, float]:
    """The minimum (k,) near z (k,) with all parameters free, and its loss; z itself if nothing is lower."""
    if z.size == 1:
        found, size = surface.minimise(z[None, :], np.zeros(1, dtype=bool))
    else:
        found, size = surface.minimise(z[None, :], np.zeros(z.size, dtype=bool), 4 * NODES)
    before = surface.loss(z[None, :])[0]
    return (found[0], float(size[0])) if size[0] <= before else (z, float(before))


def profiles(
    surface: Surface, best: Array, rise: float, far: float | None = None, nodes: int = NODES
) -> tuple[list[LossProfile], Array]:
    """One profile per parameter around the optimum ``best`` (k,), and the lowest point (k,) met on any of them.

    ``rise`` (N) is the stated rise of the loss above its least value; profiles go on until it has risen by ``far``.
    All parameters, and both directions, march side by side: the solver's price is per batch. Where the lowest point is
    lower than ``best``, the profiles should be asked for again from there.
    """
    far = FAR * rise if far is None else far
    marches = _march(surface, best, rise, far)
    k = best.size
    out, lowest, least = [], best, float(surface.loss(best[None, :])[0])
    for i in range(k):
        path, loss = marches[i]
        ends = _ends(surface, path, loss, i, least + rise)
        z, size = _resampled(surface, path, loss, i, nodes)
        out.append(LossProfile(i, z, size, ends))
        if np.min(size) < least * (1 - LOWER):
            lowest = z[int(np.argmin(size))]
    return out, lowest


def curvature(surface: Surface, z: Array) -> Array:
    """J^T J (k, k) at z (k,), per N^2."""
    j = surface.batch(z[None, :])[1][0]
    return np.asarray(j.T @ j)


def _march(surface: Surface, best: Array, rise: float, far: float) -> list[tuple[Array, Array]]:
    """(path (M, k), loss (M,)) for each parameter, from its low side to its high one, through ``best``."""
    k, low_high = best.size, surface.chart.followed
    least = float(surface.loss(best[None, :])[0])
    inverse = np.linalg.pinv(curvature(surface, best), rcond=1e-13)
    half = np.sqrt(np.maximum(np.diag(inverse), 0.0) * ((least + rise) ** 2 - least**2))
    low, high = np.minimum(low_high[0], best), np.maximum(low_high[1], best)
    step = np.clip(FIRST * half, 1e-6 * (high - low), (high - low) / 60)
    index = np.tile(np.arange(k), 2)
    side = np.repeat([-1.0, 1.0], k)
    stop = np.where(side < 0, low[index], high[index])
    h = side * step[index]
    paths = [[best] for _ in index]
    sizes = [[least] for _ in index]
    held = np.zeros((2 * k, k), dtype=bool)
    held[np.arange(2 * k), index] = True
    going = np.abs(stop - best[index]) > 1e-9 * (1 + np.abs(stop))
    # Along its profile the others follow parameter i by C_ji / C_ii, C = (J^T J)^-1.
    with np.errstate(all="ignore"):
        follow = np.nan_to_num(inverse / np.diag(inverse), posinf=0.0, neginf=0.0).T[index]
    failed = np.zeros(2 * k, dtype=int)
    for _ in range(STEPS):
        rows = np.flatnonzero(going)
        if not rows.size:
            break
        # After a step that led to no film the next one leaves the others where they are, in turn with following.
        lead = np.where(failed[:, None] % 2 == 0, follow, 0.0)
        start = np.array([_ahead(paths[r], int(index[r]), float(h[r]), float(stop[r]), lead[r]) for r in rows])
        z, size = surface.minimise(start, held[rows])
        h[rows] *= GROWTH
        for r, point, value in zip(rows, z, size, strict=True):
            if not np.isfinite(value) and failed[r] < RETRIES:
                failed[r] += 1
                h[r] *= SHORTER
                continue
            paths[r].append(point)
            sizes[r].append(float(value))
            ended = point[index[r]] == stop[r]
            going[r] = value <= least + far and not ended
    out = []
    for i in range(k):
        path = np.array([*paths[i][:0:-1], *paths[k + i]])
        out.append((path, np.array([*sizes[i][:0:-1], *sizes[k + i]])))
    return out


def _ahead(path: list[Array], i: int, h: float, stop: float, follow: Array) -> Array:
    """The next start on a path: straight on, with parameter i moved by h and not beyond ``stop``."""
    here = path[-1]
    target = here[i] + h
    target = min(target, stop) if h > 0 else max(target, stop)
    if len(path) == 1 or path[-1][i] == path[-2][i]:
        out = here + (target - here[i]) * follow
    else:
        share = (target - here[i]) / (here[i] - path[-2][i])
        out = here + min(share, 2.0) * (here - path[-2])
    out[i] = target
    return np.asarray(out)


def _ends(surface: Surface, path: Array, loss: Array, i: int, limit: float) -> tuple[End, End]:
    followed = surface.chart.followed
    at = int(np.argmin(loss))
    low, high = np.minimum(followed[0], path[at]), np.maximum(followed[1], path[at])
    sides = []
    for side, stop in ((slice(at, None, -1), low[i]), (slice(at, None), high[i])):
        z, size = path[side], loss[side]
        outside = np.flatnonzero(size > limit)
        if outside.size:
            o = int(outside[0])
            sides.append(_crossing(surface, z[o - 1], z[o], size[o], i, limit))
        else:
            sides.append(_open(surface, z, size, i, limit - float(np.min(loss)), float(stop)))
    return sides[0], sides[1]


def _crossing(surface: Surface, inside: Array, outside: Array, size: float, i: int, limit: float) -> End:
    """The end between two points of a path, by bisection helped by the slope dL/dz_i = J_i^T r / L of a profile."""
    held = np.zeros(inside.size, dtype=bool)
    held[i] = True
    a, b, z = inside, outside, inside
    trial = 0.5 * (a[i] + b[i])
    wall = not np.isfinite(size)
    value = float("nan")
    # Six parameters are dear, and where their valley ends needs fewer digits.
    few = inside.size > 2
    for turn in range(ROUNDS):
        if (wall or few) and turn >= ROUNDS_AT_A_WALL:
            break
        start = a + (trial - a[i]) / (b[i] - a[i]) * (b - a) if not wall else a.copy()
        start[i] = trial
        found, norm = surface.minimise(start[None, :], held)
        value = float(norm[0])
        if abs(value - limit) <= (5e-7 if few else 1e-9) * limit:
            return End(float(surface.chart.natural(found[0])[i]), value, Ending.RISES)
        if value <= limit:
            a = z = found[0]
        else:
            b = found[0]
            wall = not np.isfinite(value)
        if abs(b[i] - a[i]) <= 1e-10 * (1 + abs(a[i])):
            break
        r, j = (part[0] for part in surface.batch(found))
        slope = float(j[:, i] @ r) / value if np.isfinite(value) else np.nan
        trial = found[0, i] + (limit - value) / slope if slope else np.nan
        if not min(a[i], b[i]) < trial < max(a[i], b[i]):
            trial = 0.5 * (a[i] + b[i])
    reached = float(surface.loss(z[None, :])[0])
    natural = float(surface.chart.natural(z)[i])
    short = reached < limit * (1 - 1e-4)
    return End(natural, reached, Ending.NO_FILM if short else Ending.RISES)


def _open(surface: Surface, z: Array, size: Array, i: int, rise: float, stop: float) -> End:
    """The end of a side that never leaves the rise."""
    way = np.abs(z[:, i] - z[0, i])
    natural = float(surface.chart.natural(z[-1])[i])
    if abs(z[-1, i] - stop) > 1e-6 * (1 + abs(stop)) and way[-1] > 0:
        return End(natural, float(size[-1]), Ending.NOT_FOLLOWED)
    before = float(np.interp(0.9 * way[-1], way, size)) if way[-1] > 0 else float(size[-1])
    tends = abs(float(size[-1]) - before) <= FLAT * rise
    return End(natural, float(size[-1]), Ending.TENDS if tends else Ending.CHANGES)


def _resampled(surface: Surface, path: Array, loss: Array, i: int, nodes: int) -> tuple[Array, Array]:
    """``nodes`` points evenly spaced in z_i over the path, where the loss is finite, and those of the path itself."""
    good = np.isfinite(loss)
    path, loss = path[good], loss[good]
    at = np.unique(np.concatenate([np.linspace(path[0, i], path[-1, i], nodes), path[:, i]]))
    start = np.stack([np.interp(at, path[:, i], path[:, c]) for c in range(path.shape[1])], axis=1)
    return _settled(surface, start, i, path.shape[1] > 2)


def _settled(surface: Surface, start: Array, i: int, neighbours: bool) -> tuple[Array, Array]:
    """Minima with z_i held, each tried from its own start and from what its neighbours found."""
    held = np.zeros(start.shape[1], dtype=bool)
    held[i] = True
    z, size = surface.minimise(start, held)
    for shift in (1, -1):
        rows = np.arange(1, len(z)) if shift > 0 else np.arange(len(z) - 1)
        rows = rows if neighbours else rows[~np.isfinite(size[rows])]
        if not rows.size:
            continue
        other = z[rows - shift].copy()
        other[:, i] = z[rows, i]
        # Where the neighbour's film is better as it stands, another basin took over; elsewhere the two agree.
        promising = surface.loss(other) < size[rows]
        rows, other = rows[promising], other[promising]
        if not rows.size:
            continue
        found, norm = surface.minimise(other, held)
        better = norm < size[rows]
        z[rows[better]], size[rows[better]] = found[better], norm[better]
    good = np.isfinite(size)
    return z[good], size[good]


def floor(surface: Surface, profile: LossProfile, points: int, best: Array) -> tuple[Array, Array]:
    """(z (M, k), loss (M,)) of the valley's floor between the profile's ends: evenly spaced, with the optimum.

    The floor is the profile minimum: each point is the least loss with z_i held.
    """
    i = profile.index
    ends = np.array([e.value for e in profile.ends])
    wide = np.zeros((2, best.size))
    wide[:, i] = ends
    natural = surface.chart.natural(best)
    full = np.tile(natural, (2, 1))
    full[:, i] = ends
    low, high = surface.chart.from_natural(full)[:, i]
    at = np.unique(np.concatenate([np.linspace(low, high, points), [best[i]]]))
    start = np.stack([np.interp(at, profile.points[:, i], profile.points[:, c]) for c in range(best.size)], axis=1)
    start[:, i] = at
    return _settled(surface, start, i, best.size > 2)


def pair_maps(surface: Surface, best: Array, found: list[LossProfile], points: int) -> tuple[PairMap, ...]:
    """LossProfile maps of all pairs on grids of ``points`` x ``points`` over what the profiles span.

    All cells of all maps descend side by side: the solver's price is per batch. Starts are where a parabola, and where
    the profile of the first parameter, have their minimum.
    """
    k = best.size
    inverse = np.asarray(np.linalg.pinv(curvature(surface, best), rcond=1e-13), dtype=float)
    pairs = [(i, j) for i in range(k) for j in range(i + 1, k)]
    axes = [[np.linspace(found[c].points[0, c], found[c].points[-1, c], points) for c in pair] for pair in pairs]
    of_pair = np.array([[c in pair for c in range(k)] for pair in pairs])
    held = np.repeat(of_pair, points * points, axis=0)
    starts = [_starts(best, inverse, found, p, a) for p, a in zip(pairs, axes, strict=True)]
    start, other = (np.concatenate(part) for part in zip(*starts, strict=True))
    better = surface.loss(other) < surface.loss(start)
    z, size = surface.minimise(np.where(better[:, None], other, start), held, ITERATIONS_OF_A_MAP, rooted=False)
    place = np.arange(len(z)).reshape(len(pairs), points, points)
    for step in ((1, 1), (1, -1), (2, 1), (2, -1)):
        z, size = _from_neighbours(surface, z, size, place, step, held)
    return tuple(PairMap(p, a, b, size[at]) for p, (a, b), at in zip(pairs, axes, place, strict=True))


def _starts(
    best: Array, inverse: Array, found: list[LossProfile], pair: tuple[int, int], axes: list[Array]
) -> tuple[Array, Array]:
    """Starts (cells, k) of one map: along the parabola at the optimum, and along the profile of its first parameter."""
    i, j = pair
    a, b = (m.ravel() for m in np.meshgrid(*axes, indexing="ij"))
    away = np.stack([a - best[i], b - best[j]], axis=1)
    part = inverse[np.ix_([i, j], [i, j])]
    start = best + away @ np.linalg.pinv(part, rcond=1e-12) @ inverse[[i, j]]
    line = found[i].points
    other = np.stack([np.interp(a, line[:, i], line[:, c]) for c in range(best.size)], axis=1)
    for s in (start, other):
        s[:, i], s[:, j] = a, b
    return start, other


ITERATIONS_OF_A_MAP = 40
WORSE = 5e-2  # relative: a cell this much above its neighbour is tried again from there


def _from_neighbours(
    surface: Surface, z: Array, size: Array, place: NDArray[Any], step: tuple[int, int], held: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Cells above their neighbour's loss, tried again from the neighbour's film where that is below it, too.

    ``place`` (P, A, B) numbers the cells; ``step`` is the axis, and how far along it the neighbour lies.
    """
    axis, shift = step
    inner = np.ones(place.shape, dtype=bool)
    inner[(slice(None),) * axis + (0 if shift > 0 else -1,)] = False
    neighbour = np.roll(place, shift, axis=axis).ravel()
    with np.errstate(invalid="ignore"):
        again = np.flatnonzero(inner.ravel() & (size > size[neighbour] * (1 + WORSE)))
    if not again.size:
        return z, size
    start = np.where(held[again], z[again], z[neighbour[again]])
    promises = surface.loss(start) < size[again]
    again, start = again[promises], start[promises]
    found, norm = surface.minimise(start, held[again], ITERATIONS_OF_A_MAP, rooted=False)
    better = norm < size[again]
    z, size = z.copy(), size.copy()
    z[again[better]], size[again[better]] = found[better], norm[better]
    return z, size
