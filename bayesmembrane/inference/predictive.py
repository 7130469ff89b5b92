"""What a posterior predicts: bands of force inside and beyond the fitted range, and films that it never saw."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayesmembrane.errors import DataError
from bayesmembrane.forward import Forward, Prediction, Solve
from bayesmembrane.inference.run import Run
from bayesmembrane.mechanics import api
from bayesmembrane.mechanics.solution import Status
from bayesmembrane.parameters import Array
from bayesmembrane.shipped import shipped
from bayesmembrane.tables import parse_table, read_text

MASS = 0.94
DRAWS = 400
POINTS = 60
BREAK_POINTS = "paper_break_points.csv"


@dataclass(frozen=True, eq=False)
class Bands:
    """Central intervals of ``mass`` at N deflections, over the draws that have a force there (nan where none has).

    Attributes
    ----------
    deflection : (N,) m
    mean, sd : (N,) of the curve without noise, N
    low, high : (N,) interval of the curve, N
    new_low, new_high : (N,) interval of a new measured point: curve and noise, N
    extrapolated : (N,) True beyond the fitted range
    lost : (N,) part of the draws without a force
    reasons : why, for all of them, by the label of the status
    draws : how many draws stand behind it
    mass : probability of the intervals
    """

    deflection: Array
    mean: Array
    sd: Array
    low: Array
    high: Array
    new_low: Array
    new_high: Array
    extrapolated: NDArray[np.bool_]
    lost: Array
    reasons: dict[str, int]
    draws: int
    mass: float

    @property
    def sentences(self) -> list[str]:
        """What a reader of the bands must know."""
        worst = float(np.max(self.lost))
        if worst == 0:
            return []
        first = 1e3 * float(self.deflection[np.argmax(self.lost > 0)])
        causes = ", ".join(f"{k} {n}" for k, n in sorted(self.reasons.items()))
        return [
            f"From {first:.4g} mm on up to {100 * worst:.2g} % of the draws have no force any more ({causes} of "
            f"{self.draws * self.deflection.size} values); the bands show the others."
        ]


@dataclass(frozen=True)
class BreakPoint:
    """A published break point beside what the posterior predicts for that thickness.

    Attributes
    ----------
    specimen : its number
    thickness, deflection, force : m, m, N, as published
    mean, sd, low, high : predicted force, N; None where no draw has one
    extrapolated : True beyond the range that was fitted
    lost : part of the draws without a force
    ratio : published force over predicted mean
    inside : True if the published force lies in the interval
    """

    specimen: str
    thickness: float
    deflection: float
    force: float
    mean: float | None
    sd: float | None
    low: float | None
    high: float | None
    extrapolated: bool
    lost: float
    ratio: float | None
    inside: bool


def bands(
    run: Run, deflection: ArrayLike | None = None, *, draws: int = DRAWS, seed: int = 0, solve: Solve = api.solve
) -> Bands:
    """Force bands at ``deflection`` (N,) m, or from zero to the end of the whole measured range.

    A new point errs by the inferred noise and by the mean of the measurement's own.
    """
    at = _grid(run) if deflection is None else np.atleast_1d(np.asarray(deflection, dtype=float))
    x = thinned(run.draws(), draws)
    p = _predict(run, x, at, solve)
    rng = np.random.default_rng(seed)
    new = p.force + _noise(run, x)[:, None] * rng.standard_normal(p.force.shape)
    low, high = _interval(p.force)
    new_low, new_high = _interval(new)
    bad = p.status[p.status != Status.OK]
    return Bands(
        deflection=at,
        mean=_over_draws(np.nanmean, p.force),
        sd=_over_draws(np.nanstd, p.force),
        low=low,
        high=high,
        new_low=new_low,
        new_high=new_high,
        extrapolated=np.asarray(at > np.max(run.measurement.deflection) * (1 + 1e-9)),
        lost=np.mean(p.status != Status.OK, axis=0),
        reasons=dict(Counter(Status(int(s)).label for s in bad)),
        draws=len(x),
        mass=MASS,
    )


def break_points(
    run: Run, table: str | Path | None = None, *, draws: int = DRAWS, solve: Solve = api.solve
) -> list[BreakPoint]:
    """The published break points against F(delta; d') = (d'/d) F(delta; d), with the film's thickness d.

    ``table`` has the columns specimen, thickness_um, deflection_mm, force_N; by default the shipped one. A film that
    breaks may have softened before, so that a published force below the predicted one is no surprise. The interval
    holds the noise that the posterior infers.

    Raises `DataError` if the table cannot be read.
    """
    rows = _read_break_points(Path(table) if table is not None else shipped(BREAK_POINTS))
    deflection = np.array([r[2] for r in rows])
    x = thinned(run.draws(), draws)
    p = _predict(run, x, deflection, solve)
    noise = _noise(run, x)[:, None] * np.random.default_rng(0).standard_normal(p.force.shape)
    end = float(np.max(run.measurement.deflection)) * (1 + 1e-9)
    found = []
    for i, (specimen, thickness, at, force) in enumerate(rows):
        factor = thickness / run.measurement.specimen.thickness
        lost = float(np.mean(p.status[:, i] != Status.OK))
        values = factor * p.force[:, i][p.status[:, i] == Status.OK]
        spread = values + factor * noise[:, i][p.status[:, i] == Status.OK]
        known = values.size > 0
        mean = float(np.mean(values)) if known else None
        low, high = (float(v[0]) for v in _interval(spread[:, None])) if known else (None, None)
        found.append(
            BreakPoint(
                specimen=specimen,
                thickness=thickness,
                deflection=at,
                force=force,
                mean=mean,
                sd=float(np.std(values)) if known else None,
                low=low,
                high=high,
                extrapolated=at > end,
                lost=lost,
                ratio=force / mean if mean else None,
                inside=low is not None and high is not None and low <= force <= high,
            )
        )
    return found


def thinned(x: Array, most: int) -> Array:
    """At most ``most`` of the rows of x (B, k), evenly spread."""
    return x if len(x) <= most else x[np.linspace(0, len(x) - 1, most).round().astype(int)]


def _predict(run: Run, x: Array, deflection: Array, solve: Solve) -> Prediction:
    return Forward(run.hypothesis, run.measurement, deflection, solve)(x, reached=False)


def _grid(run: Run) -> Array:
    """Deflections from 0 to the end of the whole measured range, m, the end of the fitted one among them."""
    end, whole = float(np.max(run.measurement.deflection)), run.measurement.full_range
    return np.unique(np.append(np.linspace(0.0, whole, POINTS + 1), end))


def _noise(run: Run, x: Array) -> Array:
    """(B,) standard deviation of a new point, N."""
    hypothesis, own = run.hypothesis, run.measurement.force_sd
    variance = np.full(len(x), 0.0 if own is None else float(np.mean(own**2)))
    if "noise.sd" in hypothesis.natural_names:
        column = hypothesis.natural_names.index("noise.sd")
        variance += hypothesis.natural(x, run.measurement)[:, column] ** 2
    return np.asarray(np.sqrt(variance))


def _interval(values: Array) -> tuple[Array, Array]:
    """Central interval (N,), (N,) of values (B, N), leaving nan out."""
    tails = [(1 - MASS) / 2, (1 + MASS) / 2]
    low, high = _over_draws(lambda v, axis: np.nanquantile(v, tails, axis=axis), values)
    return low, high


def _over_draws(function: Any, values: Array) -> Array:
    """``function`` over the first axis; nan, and no warning, where no draw has a value."""
    empty = np.all(np.isnan(values), axis=0)
    out = np.asarray(function(np.where(empty, 0.0, values), axis=0))
    return np.where(empty, np.nan, out)


def _read_break_points(path: Path) -> list[tuple[str, float, float, float]]:
    """(specimen, thickness, deflection, force) in SI of each row."""
    table = parse_table(read_text(path), str(path))
    columns = [
        table.column(*table.require(n, q))
        for n, q in (("thickness", "length"), ("deflection", "length"), ("force", "force"))
    ]
    if "specimen" not in table.header:
        raise DataError("the column specimen is missing", str(path))
    names = [row[table.header.index("specimen")] for row in table.rows]
    return list(zip(names, *(c.tolist() for c in columns), strict=True))
