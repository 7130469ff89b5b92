"""What is known of the valleys of a loss, as frozen values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.data.fixture import Fixture
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.showable import Showable
from bayesmembrane.physics.convexity import MODES, RESTRICTING
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.valleys.between import Approach, arc_length
from bayesmembrane.valleys.next_tests import NextTest
from bayesmembrane.valleys.posterior import Grid, Spread
from bayesmembrane.valleys.profile import LossProfile, PairMap
from bayesmembrane.valleys.surface import Chart

DIP = 1e-6  # relative: a minimum along the floor must be this much lower than its neighbours


@dataclass(frozen=True)
class Metric:
    """How steps are measured: "natural" is |dp|, for parameters of one unit; "log" is |d ln|p||, a pure number."""

    name: str
    unit: str

    def scale(self, chart: Chart, z: Array) -> Array:
        """Step of the metric per step of z (B, k), shape (B, k)."""
        with np.errstate(divide="ignore"):
            size = np.ones_like(z) if self.name == "natural" else 1 / np.abs(chart.natural(z))
        return np.asarray(chart.stretch(z) * size if self.name == "natural" else np.abs(chart.stretch(z)) * size)

    def places(self, natural: Array) -> Array:
        """Points (M, k) whose Euclidean distances are those of the metric; nan where a logarithm has no value."""
        if self.name == "natural":
            return natural
        with np.errstate(divide="ignore", invalid="ignore"):
            same = np.all(np.sign(natural) == np.sign(natural[:1]), axis=0)
            return np.where(same, np.log(np.abs(natural)), np.nan)


def metric_of(chart: Chart) -> Metric:
    """Natural where all parameters share a unit, else logarithmic."""
    if len(set(chart.units)) == 1:
        return Metric("natural", chart.units[0])
    return Metric("log", "-")


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Eigenvalues (k,), the largest first, and eigenvectors (k, k), in columns, of J^T J / s^2 in a metric.

    s^2 is the residual variance |r|^2 / (N - k), so that an eigenvalue is the inverse of a variance.
    """

    metric: Metric
    values: Array
    vectors: Array

    @property
    def condition_number(self) -> float:
        """Largest over least eigenvalue; infinite if the least is zero to round-off."""
        least, most = float(self.values[-1]), float(self.values[0])
        return most / least if least > 1e-15 * most else float("inf")


@dataclass(frozen=True)
class PublishedPoint:
    """A published parameter set on this range: its loss (N, None: no film), and how far it lies from the floor.

    ``distance`` is in units of the posterior (Mahalanobis), None if it cannot be told.
    """

    label: str
    natural: tuple[float, ...]
    loss: float | None
    within: bool
    distance: float | None


@dataclass(frozen=True, eq=False)
class Valley:
    """The valley of one range; points are natural parameters.

    Attributes
    ----------
    end : m, largest deflection of the range; points : how many there are
    best, best_z, best_loss : the optimum without convexity prior, and its loss, N
    at_bound : coordinates without an optimum inside their bounds
    rise : N, the stated rise of the loss: the valley holds what lies below best_loss + rise
    along : index of the parameter that runs along the floor; the others minimise the loss
    floor, floor_z, floor_loss : (M, k), (M, k), (M,)
    kept : each convexity mode -> (M,) True where floor films meet it
    spectra : of the metric of the length first
    profiles, maps : one per parameter, one per pair
    coarse, band : grids for one and two parameters: regular, and fine around the floor; else None
    spread : posterior
    next_tests : what would shorten it, the best first
    limit : name of the simpler material whose loss is that of an open end; "" without any
    unreached : part of the cells of all maps that hold no film that reaches the data
    rig, thickness : what held the film, m: as people see its curve
    """

    hypothesis: Hypothesis
    chart: Chart
    metric: Metric
    end: float
    points: int
    best: Array
    best_z: Array
    best_loss: float
    at_bound: tuple[str, ...]
    rise: float
    along: int
    floor: Array
    floor_z: Array
    floor_loss: Array
    kept: Mapping[str, NDArray[np.bool_]]
    spectra: tuple[Spectrum, ...]
    profiles: tuple[LossProfile, ...]
    maps: tuple[PairMap, ...]
    coarse: Grid | None
    band: Grid | None
    spread: Spread
    published: tuple[PublishedPoint, ...]
    next_tests: tuple[NextTest, ...]
    limit: str
    unreached: float
    rig: Fixture | None = None
    thickness: float = math.nan

    @property
    def open_end(self) -> bool:
        """True if the floor has no end on one side."""
        return any(e.open for e in self.profiles[self.along].ends)

    def length(self, metric: Metric) -> float | None:
        """Arc length of the floor; None where the metric has none. Of an open valley: as far as it was followed."""
        length = float(arc_length(metric.places(self.floor))[-1])
        return length if np.isfinite(length) else None

    @property
    def basins(self) -> list[tuple[Array, float]]:
        """Other minima (p, loss) along the floor's profile, outside the connected part that is the valley."""
        p = self.profiles[self.along]
        low, high = sorted(e.value for e in p.ends)
        inner = p.loss[1:-1]
        dips = np.flatnonzero((inner < p.loss[:-2] * (1 - DIP)) & (inner < p.loss[2:] * (1 - DIP))) + 1
        found = [(self.chart.natural(p.points[i]), float(p.loss[i])) for i in dips]
        return [(at, loss) for at, loss in found if not low <= at[self.along] <= high]

    def share(self, mode: str) -> float:
        """Part of the floor's length that the convexity mode leaves."""
        places = self.metric.places(self.floor)
        step = np.linalg.norm(np.diff(places, axis=0), axis=1)
        kept = self.kept[mode].astype(float)
        if not step.size or not np.sum(step) > 0:
            return float(np.mean(kept))
        return float(np.sum(step * 0.5 * (kept[1:] + kept[:-1])) / np.sum(step))

    def summary(self) -> dict[str, Any]:
        """Plain values; nan and infinity become null."""
        names = [n.removeprefix(f"{self.hypothesis.material.name}.") for n in self.chart.names]
        main = self.spectra[0]
        return {
            "max_deflection_mm": 1e3 * self.end,
            "n_points": self.points,
            "parameters": names,
            "units": list(self.chart.units),
            "optimum": dict(zip(names, self.best, strict=True)),
            "loss_N": self.best_loss,
            "at_bound": list(self.at_bound),
            "loss_rise_N": self.rise,
            "loss_limit_N": self.best_loss + self.rise,
            "along": names[self.along],
            "valley": [
                {
                    **dict(zip(names, p, strict=True)),
                    "loss_N": loss,
                    **{m.name: bool(self.kept[m.name][i]) for m in RESTRICTING},
                }
                for i, (p, loss) in enumerate(zip(self.floor, self.floor_loss, strict=True))
            ],
            "direction": main.vectors[:, -1],
            "length": self.length(self.metric),
            "metric": {"name": self.metric.name, "unit": self.metric.unit},
            "length_natural": self.length(Metric("natural", "mixed")),
            "length_log": self.length(Metric("log", "-")),
            "condition_number": main.condition_number,
            "spectra": {
                s.metric.name: {
                    "eigenvalues": s.values,
                    "eigenvectors": s.vectors.T,
                    "condition_number": s.condition_number,
                }
                for s in self.spectra
            },
            "open_end": self.open_end,
            "other_basins": [{**dict(zip(names, p, strict=True)), "loss_N": loss} for p, loss in self.basins],
            "kept_by_convexity": {mode: self.share(mode) for mode in MODES},
            "profiles": {names[p.index]: self._profile(p) for p in self.profiles},
            "maps": [self._map(m, names) for m in self.maps],
            "not_reached": self.unreached,
            "grid": None if self.coarse is None or self.band is None else self._grids(),
            "posterior": {
                "source": self.spread.source,
                "mean": self.chart.natural(self.spread.mean),
                "sd": np.std(self.chart.natural(self.spread.draws), axis=0) if len(self.spread.draws) else None,
            },
            "published": [{**vars(p), "natural": dict(zip(names, p.natural, strict=True))} for p in self.published],
            "next_measurements": [t.summary() for t in self.next_tests],
        }

    def _profile(self, p: LossProfile) -> dict[str, Any]:
        natural = self.chart.natural(p.points)
        low, high = p.ends
        return {
            "value": natural[:, p.index],
            "loss_N": p.loss,
            "others": natural,
            "interval": [low.value, high.value],
            "open": [low.open, high.open],
        }

    def _map(self, m: PairMap, names: Sequence[str]) -> dict[str, Any]:
        axes = []
        for c, at in zip(m.pair, (m.first, m.second), strict=True):
            z = np.tile(self.best_z, (at.size, 1))
            z[:, c] = at
            axes.append(self.chart.natural(z)[:, c])
        return {"pair": [names[c] for c in m.pair], "first": axes[0], "second": axes[1], "loss_N": m.loss}

    def _grids(self) -> dict[str, Any]:
        assert self.coarse is not None
        assert self.band is not None
        parts = {"coarse": self.coarse, "band": self.band}
        return {
            name: {
                "natural": np.moveaxis(g.natural, -1, 0),
                "loss_N": g.loss,
                "log_posterior": g.log_posterior,
                "convex": {m.name: g.convex(m) for m in RESTRICTING},
            }
            for name, g in parts.items()
        }


@dataclass(frozen=True, eq=False)
class Between:
    """Two valleys compared; ``first`` and ``second`` are their ends in m, ``approach`` is in z."""

    first: float
    second: float
    approach: Approach
    closest: tuple[tuple[float, ...], tuple[float, ...]]
    crossing: tuple[float, ...] | None

    def summary(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "ranges_mm": [1e3 * self.first, 1e3 * self.second],
            "distance": self.approach.distance,
            "closest": self.closest,
            "cross": self.crossing is not None,
            "crossing": self.crossing,
        }


@dataclass(frozen=True, eq=False, repr=False)
class Valleys(Showable):
    """The valleys of one hypothesis on several ranges of one film; ``between`` each with each later one."""

    hypothesis: Hypothesis
    ranges: tuple[Valley, ...]
    between: tuple[Between, ...]

    @property
    def compared(self) -> tuple[tuple[Valley, Valley, Between], ...]:
        """Each valley with each later one, and how they lie to each other."""
        return tuple((a, b, c) for (a, b), c in zip(combinations(self.ranges, 2), self.between, strict=True))

    def summary(self) -> dict[str, Any]:
        """Plain values; `closest_approach` is that of the first two ranges, None with one."""
        every = [b.summary() for b in self.between]
        return {
            "material": self.hypothesis.material.name,
            "convexity": self.hypothesis.convexity.name,
            "ranges": [v.summary() for v in self.ranges],
            "closest_approach": every[0] if every else None,
            "approaches": every,
        }
