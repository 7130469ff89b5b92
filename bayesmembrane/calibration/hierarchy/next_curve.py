"""The force curve of a specimen that nobody has tested yet: what the population says of it, as a band."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bayesmembrane.calibration.hierarchy.population import Population, population
from bayesmembrane.calibration.hierarchy.specimens import LN_MODULUS, of_runs
from bayesmembrane.calibration.predictions import QUANTILES, band
from bayesmembrane.calibration.run import Run
from bayesmembrane.data.fixture import Fixture
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.noise.form import Form

DRAWS, STATIONS, SHOWN = 400, 60, 100


@dataclass(frozen=True, eq=False)
class NextCurve:
    """F(delta) of the next specimen on the rig of the first run, as thick as that one. Q stands for 5, 50 and 95 %.

    Attributes
    ----------
    rig, thickness : of the first run, m
    deflection : (G,) m, up to the largest one that was measured on such a rig
    middle : (Q, G) N, of a middling specimen: how well the population's mean is known
    curve : (Q, G) N, of the next specimen, without noise
    reading : (Q, G) N, of a measurement of it
    lost : (G,) share of the draws that have no force there; from a half on the bands are nan
    tested : (label, deflections (M,) m, forces (M,) N) of the specimens on such a rig, forces as if all were as thick
    without_form : a form error was inferred for the tested specimens, and that of the next one is in no band
    """

    rig: Fixture
    thickness: float
    deflection: Array
    middle: Array
    curve: Array
    reading: Array
    lost: Array
    tested: tuple[tuple[str, Array, Array], ...]
    without_form: bool

    def summary(self) -> dict[str, Any]:
        """Plain values of the JSON answer: quantiles by name at every deflection."""

        def quantiles(band: Array) -> dict[str, list[float]]:
            return {f"q{100 * q:02.0f}": band[i].tolist() for i, q in enumerate(QUANTILES)}

        return {
            "rig": self.rig.name,
            "thickness_um": 1e6 * self.thickness,
            "deflection_mm": (1e3 * self.deflection).tolist(),
            "force_N": quantiles(self.curve),
            "reading_N": quantiles(self.reading),
            "mean_specimen_N": quantiles(self.middle),
            "lost": self.lost.tolist(),
        }


def population_of_runs(runs: Sequence[Run], pool: Sequence[str] = (), seed: int = 0) -> Population:
    """The population behind the specimens of ``runs`` (see `of_runs`) with the curve of the next one."""
    found = population(of_runs(runs, pool), seed)
    return replace(found, next_curve=next_curve(found, runs, seed))


def next_curve(found: Population, runs: Sequence[Run], seed: int = 0) -> NextCurve:
    """Bands of F(delta; theta) with theta drawn as the next specimen is, and drawn as the population's mean is.

    What is not pooled (effects, noise) is as in the posterior of a tested specimen on such a rig, drawn at random.
    """
    rng = np.random.default_rng([seed, 22])
    first = runs[0]
    rig, film, claim = first.measurement.rig, first.measurement.specimen, first.hypothesis
    alike = [r for r in runs if r.measurement.rig.name == rig.name and r.hypothesis.names == claim.names]
    end = max(float(np.max(r.measurement.deflection)) for r in alike)
    at = np.linspace(end / STATIONS, end, STATIONS)
    chosen = rng.choice(len(found.following), size=min(DRAWS, len(found.following)), replace=False)
    others = _drawn(alike, chosen.size, rng)
    forward = Forward(claim, first.measurement, at)
    middle, curve = (
        forward(_joined(found, theta[chosen], others, first), reached=False).force
        for theta in (found.mean, found.following)
    )
    names = claim.natural_names
    sd = claim.natural(others, first.measurement)[:, [names.index("noise.sd")]] if "noise.sd" in names else 0.0
    order = np.argsort(first.measurement.deflection)
    own = first.measurement.force_sd
    stated = 0.0 if own is None else np.interp(at, first.measurement.deflection[order], own[order])
    reading = curve + np.hypot(sd, stated) * rng.standard_normal(curve.shape)
    labels = dict(zip((id(r) for r in runs), found.specimens.labels, strict=True))
    return NextCurve(
        rig=rig,
        thickness=film.thickness,
        deflection=at,
        middle=band(middle),
        curve=band(curve),
        reading=band(reading),
        lost=np.mean(~np.isfinite(curve), axis=0),
        tested=tuple((labels[id(r)], *_shown(r, film.thickness)) for r in alike),
        without_form=isinstance(claim.noise, Form),
    )


def _drawn(runs: Sequence[Run], count: int, rng: np.random.Generator) -> Array:
    """(count, k) posterior draws of runs, taken at random."""
    every = [run.draws() for run in runs]
    which = rng.integers(len(every), size=count)
    return np.stack([every[w][rng.integers(len(every[w]))] for w in which])


def _joined(found: Population, theta: Array, others: Array, first: Run) -> Array:
    """Coordinates (B, k) of specimens with pooled coordinates ``theta`` (B, q), as thick as the first run's film."""
    x, names, material = others.copy(), first.hypothesis.names, first.hypothesis.material.name
    for i, name in enumerate(found.specimens.names):
        if name == LN_MODULUS:
            x[:, names.index(f"{material}.ln_gd")] = theta[:, i] + np.log(first.measurement.specimen.thickness)
        else:
            x[:, names.index(name if name in names else f"{material}.{name}")] = theta[:, i]
    return x


def _shown(run: Run, thickness: float) -> tuple[Array, Array]:
    m = run.measurement
    rows = np.unique(np.linspace(0, len(m) - 1, min(len(m), SHOWN)).astype(int))
    return m.deflection[rows], m.force[rows] * thickness / m.specimen.thickness
