"""What to measure next: which further test would shorten the valley most, from sensitivities at the posterior."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from bayesmembrane.ground.parameters import Array
from bayesmembrane.next_test.further import FurtherTest, Kind, Simulation, other_ranges, other_specimens, same_again
from bayesmembrane.next_test.gain import information, longest_axis
from bayesmembrane.physics.rigs.base import rig_of
from bayesmembrane.valleys.posterior import NormalPosterior, Spread
from bayesmembrane.valleys.surface import Surface

DRAWS = 24
USUAL_STRETCH = 3.0  # of other specimens, where the present film is stretched alike everywhere


@dataclass(frozen=True)
class NextTest:
    """A candidate measurement and what it is worth.

    test : what to do
    axis_before, axis_after : longest axis of the posterior (standard deviation) now and with the test, in the metric
        of the valley's length, medians over posterior draws
    reduction : expected relative reduction of the longest axis, mean over posterior draws
    """

    test: FurtherTest
    axis_before: float
    axis_after: float
    reduction: float

    @property
    def kind(self) -> str:
        """What is done, in a word: the rig of another specimen, or the kind of the test."""
        return self.test.rig or self.test.kind.value

    def summary(self) -> dict[str, float | str]:
        """Plain values."""
        return {
            "kind": self.kind,
            "axis_before": self.axis_before,
            "axis_after": self.axis_after,
            "reduction": self.reduction,
        }


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
    before, scales = normal.precision(z), scale(z)
    to_z = surface.coordinate_slopes(x, z)
    out = []
    for candidate in _candidates(surface, x):
        signals = candidate.signals(surface.hypothesis, x, surface.objective.forward.solve)
        if candidate.test.kind is Kind.REPEAT:
            slopes = np.einsum("mn,bnk->bmk", normal.whitening, signals.slopes)
        else:
            with np.errstate(all="ignore"):
                slopes = signals.over_noise(normal.noise_share)
        known = information(np.einsum("bmi,bij->bmj", slopes, to_z))
        good = np.flatnonzero(np.all(np.isfinite(before + known), axis=(1, 2)) & np.all(np.isfinite(scales), axis=1))
        if 2 * good.size < len(z):
            continue
        long = longest_axis(before[good], scales[good])
        short = longest_axis(before[good] + known[good], scales[good])
        reduction = float(np.mean(1 - short / long))
        out.append(NextTest(candidate.test, float(np.median(long)), float(np.median(short)), reduction))
    return tuple(sorted(out, key=lambda t: -t.reduction))


def _draws(normal: NormalPosterior, spread: Spread) -> Array:
    """The mode and up to `DRAWS` posterior draws (B, k) that have a film."""
    step = max(1, len(spread.draws) // DRAWS)
    z = np.concatenate([normal.z[None, :], spread.draws[::step][:DRAWS]])
    x = normal.surface.chart.coordinates(z)
    return z[np.all(np.isfinite(x), axis=1)]


def _candidates(surface: Surface, x: Array) -> Iterator[Simulation]:
    """The same test again, other ranges of a film that is stretched unevenly, and strips as far as it is stretched."""
    m = surface.measurement
    yield same_again(m)
    stretch = USUAL_STRETCH
    if not rig_of(m).homogeneous:
        yield from other_ranges(m)
        curves = surface.objective.forward.curves(surface.hypothesis.films(x), m.deflection)
        stretch = float(np.nanmedian(curves.max_stretch.max(axis=1)))
    if np.isfinite(stretch) and stretch > 1:
        yield from other_specimens(m, stretch)
