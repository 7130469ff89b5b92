"""What to measure next: which further test would shorten the valley most, from sensitivities at the posterior."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.rigs.base import Rig, rig_of
from bayesmembrane.valleys.posterior import NormalPosterior, Spread
from bayesmembrane.valleys.surface import Surface

FURTHER = (1.25, 1.5)
SMALL = 0.3
DRAWS = 24
ASSUMPTION = (
    "Each test has as many points as the present one (a biaxial point holds two tensions), and its noise is the same "
    "share of its largest force; films in strips are stretched as far as the present test stretches them."
)


@dataclass(frozen=True)
class NextTest:
    """A candidate measurement and what it is worth.

    test : what to do, in words
    kind : "further range", "small deflections", "repeat" or the strip's kind
    axis_before, axis_after : longest axis of the posterior (standard deviation) now and with the test, in the metric
        of the valley's length, medians over posterior draws
    reduction : expected relative reduction of the longest axis, mean over posterior draws
    """

    test: str
    kind: str
    axis_before: float
    axis_after: float
    reduction: float

    def summary(self) -> dict[str, float | str]:
        """Plain values."""
        return dict(vars(self))


Information = Callable[[Array, Array], Array]
"""x (B, k), z (B, k) -> signal slopes dS/dz (B, M, k) over the noise's standard deviation."""


def rank(
    surface: Surface, normal: NormalPosterior, spread: Spread, scale: Callable[[Array], Array]
) -> tuple[NextTest, ...]:
    """All candidates, best first: those for which less than half of the draws have a film are left out.

    With the Fisher information I of the data, prior precision P and the candidate's information K = sum of
    (dS/dz)^T (dS/dz) / sd^2, the longest axis is the root of the largest eigenvalue of T (I + P)^-1 T before, and of
    T (I + P + K)^-1 T after; T = diag(``scale``(z)) brings z to the metric of the valley's length.
    """
    z = _draws(normal, spread)
    x = surface.chart.coordinates(z)
    before = normal.precision(z)
    scales = scale(z)
    out = []
    for text, kind, slopes in _candidates(surface, normal, z, x):
        with np.errstate(all="ignore"):
            known = np.einsum("bmk,bml->bkl", slopes, slopes)
        good = np.flatnonzero(np.all(np.isfinite(before + known), axis=(1, 2)) & np.all(np.isfinite(scales), axis=1))
        if 2 * good.size < len(z):
            continue
        long = _longest(before[good], scales[good])
        short = _longest(before[good] + known[good], scales[good])
        reduction = float(np.mean(1 - short / long))
        out.append(NextTest(text, kind, float(np.median(long)), float(np.median(short)), reduction))
    return tuple(sorted(out, key=lambda t: -t.reduction))


def _draws(normal: NormalPosterior, spread: Spread) -> Array:
    """The mode and up to `DRAWS` posterior draws (B, k) that have a film."""
    step = max(1, len(spread.draws) // DRAWS)
    z = np.concatenate([normal.z[None, :], spread.draws[::step][:DRAWS]])
    x = normal.surface.chart.coordinates(z)
    return z[np.all(np.isfinite(x), axis=1)]


def _longest(precision: Array, scale: Array) -> Array:
    """(B,) root of the largest eigenvalue of T precision^-1 T: the least of the inverse is found more exactly."""
    scaled = precision / scale[:, :, None] / scale[:, None, :]
    least = np.linalg.eigvalsh(scaled)[:, 0]
    return np.asarray(1 / np.sqrt(np.maximum(least, 1e-300)))


def _candidates(surface: Surface, normal: NormalPosterior, z: Array, x: Array) -> Iterator[tuple[str, str, Array]]:
    m = surface.measurement
    n, end = len(m), float(np.max(m.deflection))
    root = normal.whitening
    yield "the same test once more", "repeat", np.einsum("mn,bnk->bmk", root, surface.batch(z)[1])
    most = np.full(len(z), 3.0)
    if not rig_of(m).homogeneous:
        most = surface.objective.forward.curves(surface.hypothesis.films(x), m.deflection).max_stretch.max(axis=1)
        ends = sorted({end * f for f in FURTHER} | ({m.full_range} if m.full_range > end * (1 + 1e-9) else set()))
        spaces = []
        for e in ends:
            risk = "" if e <= m.full_range * (1 + 1e-9) else ", further than it was tested (it may break)"
            words = f"the same film from {1e3 * end:.3g} to {1e3 * e:.3g} mm{risk}"
            spaces.append((words, "further range", end, e))
        spaces.append((f"small deflections, up to {1e3 * SMALL * end:.3g} mm", "small deflections", 0.0, SMALL * end))
        for text, kind, low, high in spaces:
            at = np.linspace(low, high, n + 1)[1:]
            yield text, kind, _film_slopes(surface, z, x, at, normal.noise_share)
    stretch = float(np.nanmedian(most))
    if not np.isfinite(stretch) or stretch <= 1:
        return
    proposing: list[type[Rig]] = [r for r in components("rigs").values() if r.proposal]
    at = np.linspace(1, stretch, n + 1)[1:]
    for rig in proposing:
        words = f"{rig.proposal}, stretched up to {stretch:.3g}"
        yield words, rig.name, _strip_slopes(surface, z, at, rig, normal.noise_share)


def _film_slopes(surface: Surface, z: Array, x: Array, at: Array, share: float) -> Array:
    """dF/dz over the noise (B, M, k) at deflections ``at`` (M,)."""
    forward = surface.objective.forward
    # The new test is one path of its own; its range must not be told to the measurement's.
    other = Forward(forward.hypothesis, replace(surface.measurement, full_range=float(np.max(at))), at, forward.solve)
    prediction = other(x, sensitivities=True, reached=False)
    assert prediction.sensitivity is not None
    slopes = np.einsum("bmi,bij->bmj", prediction.sensitivity, surface.coordinate_slopes(x, z))
    sd = share * np.max(np.abs(prediction.force), axis=1)
    return np.asarray(slopes / sd[:, None, None])


def _strip_slopes(surface: Surface, z: Array, l1: Array, rig: type[Rig], share: float) -> Array:
    """d(nominal tensions)/dz over the noise (B, M or 2 M, k) of the test that the rig proposes; measured ones count."""
    n = surface.hypothesis.material_size
    p = surface.chart.natural(z)[:, :n]
    l2, measured = rig.proposed(l1)
    columns = p.T[:, :, None]
    with np.errstate(all="ignore"):
        _, p1, p2, *_ = surface.hypothesis.material.derivatives(columns, l1[None, :], l2[None, :])
        parts = surface.hypothesis.material.sensitivities(columns, l1[None, :], l2[None, :])
    shape = (len(z), l1.size)
    tensions = [np.broadcast_to(p1, shape), np.broadcast_to(p2, shape)]
    slopes = [np.stack([np.broadcast_to(part[i], shape) for part in parts], axis=2) for i in (1, 2)]
    out = np.zeros((len(z), l1.size * len(measured), z.shape[1]))
    for row, i in enumerate(m - 1 for m in measured):
        sd = share * np.max(np.abs(tensions[i]), axis=1)
        part = slopes[i] * surface.chart.stretch(z)[:, None, :n] / sd[:, None, None]
        out[:, row * l1.size : (row + 1) * l1.size, :n] = part
    return out
