"""What the paper's break points and its three speeds say on thickness, speed and scatter, and what they cannot say.

    python -m tests.studies.paper_breaks

writes docs/studies/paper_breaks.md.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import stats
from scipy.interpolate import PchipInterpolator

from bayesmembrane.calibration.beside_paper import BreakPoint, paper_break_points, paper_rates
from bayesmembrane.calibration.fit import fit
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.shipped import shipped
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import material, ordinary_materials
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis

TARGET = Path(__file__).resolve().parents[2] / "docs" / "studies" / "paper_breaks.md"
LEVEL = 0.05
POWER = 0.9
CURVE = "elastosil_50um_first_loading"
SPEEDS_AT = 0.1
"""m: deflection of the forces at three speeds."""


@dataclass(frozen=True)
class Scatter:
    """Standard deviation of one specimen within its group, pooled, with its degrees of freedom."""

    sd: float
    dof: int

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the standard deviation, from chi-square."""
        low, high = stats.chi2.ppf([0.975, 0.025], self.dof)
        return float(self.sd * np.sqrt(self.dof / low)), float(self.sd * np.sqrt(self.dof / high))

    def half_width(self, variance: float = 1.0) -> float:
        """Half of the 95 % interval of a contrast with ``variance`` times that of one specimen."""
        return float(stats.t.ppf(0.975, self.dof) * self.sd * np.sqrt(variance))


def within(values: Array, groups: Sequence[object]) -> Scatter:
    """Pooled standard deviation of ``values`` (N,) within ``groups`` (N,): what replicates differ by."""
    keys = dict.fromkeys(groups)
    parts = [values[[g == k for g in groups]] for k in keys]
    dof = sum(p.size - 1 for p in parts)
    return Scatter(float(np.sqrt(sum(np.sum((p - p.mean()) ** 2) for p in parts) / dof)), dof)


def between(values: Array, groups: Sequence[object]) -> float:
    """p-value of one-way analysis of variance: groups have one mean."""
    parts = [values[[g == k for g in groups]] for k in dict.fromkeys(groups)]
    return float(stats.f_oneway(*parts).pvalue)


def beyond_scatter(values: Array, scatter: Scatter) -> float:
    """p-value that single specimens ``values`` (k,) differ by no more than replicates do: F(k - 1, dof)."""
    ratio = np.var(values, ddof=1) / scatter.sd**2
    return float(stats.f.sf(ratio, values.size - 1, scatter.dof))


def trend(x: Array, y: Array, scatter: Scatter) -> tuple[float, float]:
    """(slope, half of its 95 % interval) of y (N,) over x (N,), with the scatter of replicates as the error."""
    centred = x - x.mean()
    return float(centred @ y / (centred @ centred)), scatter.half_width(1 / float(centred @ centred))


def specimens_needed(scatter: Scatter, effect: float) -> int:
    """Specimens in each of two groups that show a difference ``effect`` at 5 % nine times in ten (normal formula)."""
    z = stats.norm.ppf(1 - LEVEL / 2) + stats.norm.ppf(POWER)
    return int(np.ceil(2 * (z * scatter.sd / effect) ** 2))


@dataclass(frozen=True, eq=False)
class Film:
    """One energy on the curve of specimen 1, scaled to the specimens that broke.

    rmse : N, of the fit to the whole curve
    force : (N,) N, predicted at the breaks; nan where the film has no solution
    stretch : (N,) largest stretch there
    """

    title: str
    rmse: float
    force: Array
    stretch: Array


def films(curve: Measurement, breaks: Sequence[BreakPoint], names: Iterable[str] = ()) -> list[Film]:
    """Every energy, or those of ``names``, fitted to the whole curve by least squares; forces go with the thickness."""
    at = np.array([b.deflection for b in breaks])
    thicker = np.array([b.thickness for b in breaks]) / curve.specimen.thickness
    order = np.unique(at)
    found = []
    for name in names or ordinary_materials():
        best = fit(curve, hypothesis(name))
        forward = Forward(best.hypothesis, curve, order)
        curves = forward.curves(best.hypothesis.films(best.coordinates[None, :]), order)
        place = np.searchsorted(order, at)
        found.append(
            Film(material(name).title, best.rmse_N, curves.force[0, place] * thicker, curves.max_stretch[0, place])
        )
    return found


def scaled(curve: Measurement, breaks: Sequence[BreakPoint]) -> Array:
    """(N,) N: the curve of specimen 1 at the break deflections, times the thickness; nan beyond its end.

    Between its points ln F is interpolated by a monotone cubic: no energy is assumed.
    """
    log_force = PchipInterpolator(curve.deflection, np.log(curve.force), extrapolate=False)
    thicker = np.array([b.thickness for b in breaks]) / curve.specimen.thickness
    return np.asarray(np.exp(log_force([b.deflection for b in breaks])) * thicker)


def main() -> None:
    """Compute, and write the page."""
    from tests.studies.paper_breaks_page import page

    curve = read_measurement(shipped(f"{CURVE}.csv"), shipped(f"{CURVE}.toml"))
    breaks = paper_break_points()
    text = page(curve, breaks, paper_rates(), scaled(curve, breaks), films(curve, breaks))
    TARGET.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
