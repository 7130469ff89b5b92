"""Valleys: where many parameter sets fit nearly as well as the best one, how long, and what would shorten that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import interp1d

from bayesmembrane.calibration.fit import fit
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.published import read_published_table
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.pieces import piece, within
from bayesmembrane.ground.registry import ordinary_materials
from bayesmembrane.physics.convexity import FREE, MODES
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics.api import unaided
from bayesmembrane.valleys.between import closest_approach
from bayesmembrane.valleys.next_tests import rank
from bayesmembrane.valleys.posterior import (
    Grid,
    NormalPosterior,
    Spread,
    grid,
    posterior_margin,
    spread_of_draws,
    spread_of_grid,
)
from bayesmembrane.valleys.profile import LossProfile, floor, optimum, pair_maps, profiles
from bayesmembrane.valleys.result import Between, Metric, PublishedPoint, Spectrum, Valley, Valleys, metric_of
from bayesmembrane.valleys.surface import Surface

RISE = 0.1
"""The valley holds what fits within this part of the least loss, unless asked otherwise."""

FLOOR, FLOOR_OF_MANY = 121, 61
COARSE, ALONG, ACROSS = 41, 81, 41
SDS = 4.0
MAP = {3: 17}
MAP_OF_MANY = 9  # also with effects, whose curves are dear
WIDER = 1.0  # of the least loss: how far profiles of one or two parameters, and the band around a floor, go
AGAIN = 3
JUMP = 10.0  # a step of the floor this many times the median one leads to another basin
SAME = 1e-3  # relative: an open end's loss this close to a simpler material's is that material


def valleys(
    measurement: Measurement,
    hypothesis: Hypothesis,
    ranges: Sequence[float] = (),
    *,
    rise: float = RISE,
    seed: int = 0,
    solve: Solve = unaided,
) -> Valleys:
    """The valleys of ``hypothesis`` on ``measurement`` cut at each of ``ranges`` (m; the whole one without any).

    See `valleys_of`.
    """
    parts = measurement.ranges_up_to(ranges) or [measurement]
    return valleys_of(parts, hypothesis, rise=rise, seed=seed, solve=solve)


def valleys_of(
    measurements: Sequence[Measurement],
    hypothesis: Hypothesis,
    *,
    rise: float = RISE,
    seed: int = 0,
    draws: Sequence[Array | None] | None = None,
    solve: Solve = unaided,
) -> Valleys:
    """One valley per measurement of one film, each compared with each.

    The loss is the Euclidean one, |F - y|_2 in N, without convexity prior; the valley is where it is at most
    (1 + ``rise``) times its least value. ``draws`` are coordinates (B, k) of a run on each measurement; without them
    the posterior comes from a grid (one or two parameters) or is a normal distribution at its mode.

    Raises `SettingsError` for a rise that is not positive, and what `calibration.fit.fit` raises.
    """
    if not 0 < rise < np.inf:
        raise SettingsError(f"the loss cannot rise by {rise:g} of itself", remedy="give a positive number, such as 0.1")
    surfaces = [Surface(hypothesis, m, solve) for m in measurements]
    if draws is not None:
        draws = [d if d is None else _in_question(hypothesis, m, d) for d, m in zip(draws, measurements, strict=True)]
    found = []
    for i, surface in enumerate(surfaces):
        with within(str(i)):
            found.append(_valley(surface, rise, seed, None if draws is None else draws[i]))
    if hypothesis.curve_size <= 2:
        coarse = piece("coarse", lambda: _coarse(surfaces, found))
        found = [replace(v, coarse=g) for v, g in zip(found, coarse, strict=True)]
    pairs = tuple(between(a, b) for a, b in combinations(found, 2))
    return Valleys(hypothesis, tuple(found), pairs)


def _in_question(hypothesis: Hypothesis, measurement: Measurement, draws: Array) -> Array:
    """Coordinates (B, k) of a run without those of what was known of the rig, which a surface holds."""
    claim = hypothesis.with_frame(measurement)
    return draws[:, [p.name not in claim.known_coordinates for p in claim.parameters[: draws.shape[1]]]]


def _valley(surface: Surface, rise: float, seed: int, draws: Array | None) -> Valley:
    h, m, chart = surface.hypothesis, surface.measurement, surface.chart
    published = _published(h, m)
    starts = [p for _, p in published]
    fitted = piece("fit", lambda: fit(m, replace(h, convexity=FREE), seed=seed, starts=starts))
    start = chart.from_coordinates(fitted.coordinates)[0]
    best, least, lines = piece("lines", lambda: _lines(surface, start, rise))
    metric = metric_of(chart)
    spectra = tuple(_spectrum(surface, best, s) for s in _metrics(metric))
    along = _along(lines, spectra[0])
    count = FLOOR if best.size <= 2 else FLOOR_OF_MANY
    floor_z, floor_loss = piece("floor", lambda: floor(surface, lines[along], count, best))
    inside = floor_loss <= (least + rise * least) * (1 + 1e-6)
    inside[inside] = _connected(floor_z[inside], best)
    floor_z, floor_loss = floor_z[inside], floor_loss[inside]
    k = best.size
    points = MAP_OF_MANY if h.effects else MAP.get(k, MAP_OF_MANY)
    maps = piece("maps", lambda: pair_maps(surface, best, lines, points)) if k > 2 else ()
    normal = NormalPosterior(surface, best)
    band = piece("band", lambda: _band(surface, lines[along], least, normal)) if k <= 2 else None
    spread = piece("spread", lambda: _spread(surface, normal, band, along, draws, seed))
    valley = Valley(
        hypothesis=h,
        chart=chart,
        metric=metric,
        end=float(np.max(m.deflection)),
        points=len(m),
        best=chart.natural(best),
        best_z=best,
        best_loss=least,
        at_bound=fitted.at_bound,
        rise=rise * least,
        along=along,
        floor=chart.natural(floor_z),
        floor_z=floor_z,
        floor_loss=floor_loss,
        kept={n: posterior_margin(surface, floor_z, m) for n, m in MODES.items()},
        spectra=spectra,
        profiles=tuple(lines),
        maps=maps,
        coarse=None,
        band=band,
        spread=spread,
        published=(),
        next_tests=piece("tests", lambda: rank(surface, normal, spread, lambda z: metric.scale(chart, z))),
        limit=piece("limit", lambda: _limit(surface, lines[along], seed)),
        unreached=float(np.mean([np.mean(~np.isfinite(p.loss)) for p in maps])) if maps else 0.0,
        rig=m.rig,
        thickness=m.specimen.thickness,
    )
    return replace(valley, published=tuple(_placed(surface, valley, label, p) for label, p in published))


def _lines(surface: Surface, start: Array, rise: float) -> tuple[Array, float, list[LossProfile]]:
    """Optimum (k,), its loss, and all profiles; again from where a profile finds a lower optimum."""
    for _ in range(AGAIN):
        best, least = optimum(surface, start)
        far = max(WIDER * least, 3 * rise * least) if best.size <= 2 else None
        lines, start = profiles(surface, best, rise * least, far)
        if np.array_equal(start, best):
            break
    return best, least, lines


def _connected(line: Array, best: Array) -> NDArray[np.bool_]:
    """(M,) True for the part of the floor around the optimum that does not jump: beyond a jump lies another basin."""
    if len(line) < 3:
        return np.ones(len(line), dtype=bool)
    step = np.linalg.norm(np.diff(line, axis=0), axis=1)
    jump = step > np.maximum(JUMP * np.median(step), 1e-6)
    piece = np.concatenate([[0], np.cumsum(jump)])
    return np.asarray(piece == piece[int(np.argmin(np.linalg.norm(line - best, axis=1)))])


def _metrics(main: Metric) -> tuple[Metric, ...]:
    other = Metric("log", "-") if main.name == "natural" else Metric("natural", "mixed")
    return main, other


def _spectrum(surface: Surface, best: Array, metric: Metric) -> Spectrum:
    """Eigenvalues and vectors of T^-1 J^T J T^-1 / s^2, with T from z to the metric."""
    scale = metric.scale(surface.chart, best[None, :])[0]
    loss = float(surface.loss(best[None, :])[0])
    dof = max(len(surface.measurement) - best.size, 1)
    j = surface.batch(best[None, :])[1][0] / scale / (loss / np.sqrt(dof))
    if not np.all(np.isfinite(j)):
        return Spectrum(metric, np.full(best.size, np.nan), np.full((best.size, best.size), np.nan))
    # Singular values keep what squaring them would lose.
    _, values, axes = np.linalg.svd(j, full_matrices=False)
    signs = np.sign(axes[np.arange(len(axes)), np.argmax(np.abs(axes), axis=1)])
    return Spectrum(metric, values**2, (axes * signs[:, None]).T)


def _along(lines: Sequence[LossProfile], spectrum: Spectrum) -> int:
    """The parameter with an open end, if there is one; else the largest in the weakest direction."""
    weakest = np.abs(np.nan_to_num(spectrum.vectors[:, -1]))
    opened = [i for i, p in enumerate(lines) if any(e.open for e in p.ends)]
    return max(opened or range(len(lines)), key=lambda i: weakest[i])


def _band(surface: Surface, line: LossProfile, least: float, normal: NormalPosterior) -> Grid:
    """A grid that follows the floor: `ALONG` places, and `ACROSS` to both sides, dense near the floor.

    It holds the profile and `SDS` standard deviations of the normal posterior to every side of its mode.
    """
    i, k = line.index, line.points.shape[1]
    covariance = normal.spread().covariance
    low, high = surface.chart.followed
    reach = SDS * float(np.sqrt(covariance[i, i]))
    start = max(min(line.points[0, i], normal.z[i] - reach), min(low[i], line.points[0, i]))
    stop = min(max(line.points[-1, i], normal.z[i] + reach), max(high[i], line.points[-1, i]))
    at = np.linspace(start, stop, ALONG)
    if k == 1:
        return grid(surface, at[:, None])
    z = np.stack([interp1d(line.points[:, i], c, fill_value="extrapolate")(at) for c in line.points.T], axis=1)
    z[:, i] = at
    z, size = surface.minimise(np.asarray(z, dtype=float), np.arange(k) == i)
    z, at = z[np.isfinite(size)], at[np.isfinite(size)]
    o = 1 - i
    r, j = surface.batch(z)
    rise = ((1 + WIDER) * 1.3 * least) ** 2 - np.sum(r * r, axis=1)
    half = np.sqrt(np.maximum(rise, 0.1 * least**2) / np.sum(j[:, :, o] ** 2, axis=1))
    if np.any(known := np.isfinite(half)):  # a film without slopes, among others that have them, has a width like them
        half = np.interp(at, at[known], half[known])
    # Where the posterior weighs the points otherwise than the loss does, its ridge runs beside the floor.
    slope = covariance[o, i] / covariance[i, i]
    ridge = normal.z[o] + slope * (at - normal.z[i]) - z[:, o]
    width = SDS * float(np.sqrt(max(covariance[o, o] - slope * covariance[o, i], 0.0)))
    near = np.abs(at - normal.z[i]) < reach
    half = np.where(near, np.maximum(half, np.minimum(np.abs(ridge) + width, 4 * half)), half)
    t = np.linspace(-1, 1, ACROSS)
    wide = np.repeat(z[:, None, :], ACROSS, axis=1)
    wide[:, :, o] += half[:, None] * t * (0.3 + 0.7 * t * t)
    return grid(surface, wide)


def _cells(band: Grid, along: int) -> Array:
    """Volumes of the band's cells in natural parameters."""
    p = band.natural
    if p.shape[-1] == 1:
        return np.abs(np.gradient(p[:, 0]))
    return np.abs(np.gradient(p[:, 0, along])[:, None] * np.gradient(p[:, :, 1 - along], axis=1))


def _spread(
    surface: Surface, normal: NormalPosterior, band: Grid | None, along: int, draws: Array | None, seed: int
) -> Spread:
    if draws is not None and len(draws):
        return spread_of_draws(surface, draws)
    if band is not None:
        found = spread_of_grid(band, _cells(band, along), FREE, seed)
        if np.all(np.isfinite(found.covariance)) and np.all(np.diag(found.covariance) > 0):
            return found
    return normal.spread(seed)


def _coarse(surfaces: Sequence[Surface], found: Sequence[Valley]) -> list[Grid]:
    """Regular grids over one box that holds all valleys and published points."""
    z = np.concatenate([v.band.z.reshape(-1, v.best.size) for v in found if v.band is not None])
    z = np.concatenate([z, *(v.chart.from_natural(np.array([p.natural])) for v in found for p in v.published)])
    low, high = np.nanmin(z, axis=0), np.nanmax(z, axis=0)
    axes = [np.linspace(a, b, COARSE) for a, b in zip(low, high, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return [grid(s, nodes) for s in surfaces]


def _limit(surface: Surface, line: LossProfile, seed: int) -> str:
    """Name of the simpler material that the loss at an open end belongs to."""
    ends = [e for e in line.ends if e.open]
    if not ends or surface.hypothesis.effects:
        return ""
    for name, kind in ordinary_materials().items():
        if len(kind.field_names()) >= surface.chart.size or name == surface.hypothesis.material.name:
            continue
        simple = fit(surface.measurement, replace(surface.hypothesis, material=kind, convexity=FREE), seed=seed)
        if abs(simple.loss_N - ends[-1].loss) <= SAME * ends[-1].loss:
            return name
    return ""


def _published(hypothesis: Hypothesis, measurement: Measurement) -> list[tuple[str, Array]]:
    """Published parameters (label, p) of this material, if the film is the published one."""
    # The film's name tells: other films have other thicknesses and other silicones.
    if hypothesis.effects or "ELASTOSIL" not in measurement.specimen.name:
        return []
    rows = read_published_table().rows
    return [(r.column, np.array(r.values)) for r in rows if r.material == hypothesis.material.name]


def _placed(surface: Surface, valley: Valley, label: str, p: Array) -> PublishedPoint:
    z = surface.chart.from_natural(p[None, :])
    loss = float(surface.loss(z)[0]) if np.all(np.isfinite(z)) else np.inf
    distance = None
    if np.all(np.isfinite(z)) and np.all(np.isfinite(valley.spread.covariance)):
        distance = closest_approach(valley.floor_z, z, valley.spread.covariance).distance
    known = loss if np.isfinite(loss) else None
    natural = tuple(float(v) for v in p)
    return PublishedPoint(label, natural, known, loss <= valley.best_loss + valley.rise, distance)


def between(a: Valley, b: Valley) -> Between:
    """Closest approach of two floors, in units of C_a + C_b: that of a difference of independent estimates.

    Where ``b`` has more parameters, they come last and are left out.
    """
    k = a.best.size
    covariance = a.spread.covariance + b.spread.covariance[:k, :k]
    approach = closest_approach(a.floor_z, b.floor_z[:, :k], covariance)
    one, two = (tuple(float(v) for v in a.chart.natural(p)) for p in (approach.first, approach.second))
    crossing = None if approach.crossing is None else tuple(float(v) for v in a.chart.natural(approach.crossing))
    return Between(a.end, b.end, approach, (one, two), crossing)
