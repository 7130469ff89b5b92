"""What each specimen says by itself of the coordinates that a population is asked about."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayesmembrane.calibration.joint.claim import labelled
from bayesmembrane.calibration.run import Run
from bayesmembrane.ground.errors import SettingsError, unknown_name
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.symmetric import eigh

LN_MODULUS = "ln_modulus"
"""ln(G / Pa): the first coordinate of every material less ln(thickness), for films of one rubber share no G d."""
FLAT = 1e-9
"""Least precision of a specimen, relative to that of the prior: one that says nothing."""
SKEWED = 0.5
"""Skewness of draws from which on a normal likelihood is no good summary of them."""


@dataclass(frozen=True, eq=False)
class Specimens:
    """J specimens, each with a normal likelihood of q coordinates: z_j ~ N(theta_j, S_j) of its own theta_j.

    labels, names : (J,) specimens, (q,) coordinates
    values, covariances : (J, q) z_j, (J, q, q) S_j; a specimen may be certain (zero)
    centre, spread : (q,) mean and standard deviation of the normal prior on the population's mean
    skewed : specimens whose draws a normal summarises badly

    Raises `SettingsError` for fewer than two specimens, and for shapes or numbers that do not go together.
    """

    labels: tuple[str, ...]
    names: tuple[str, ...]
    values: Array
    covariances: Array
    centre: Array
    spread: Array
    skewed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        j, q = len(self.labels), len(self.names)
        if j < 2:
            raise SettingsError("a population needs two specimens at least", remedy="calibrate another specimen")
        shapes = (self.values.shape, self.covariances.shape, self.centre.shape, self.spread.shape)
        if shapes != ((j, q), (j, q, q), (q,), (q,)) or not all(
            np.all(np.isfinite(v)) for v in (self.values, self.covariances, self.centre, self.spread)
        ):
            raise SettingsError("values, covariances and priors of the specimens do not go together")


def of_runs(runs: Sequence[Run], pool: Sequence[str] = ()) -> Specimens:
    """Specimens from one run each, of the same material: what the data alone say of it.

    ``pool`` names coordinates: ``ln_modulus`` and all others of the material, unless given; those of effects by their
    full names, as ``thickness.error``. The draws' mean and covariance, less what the prior put into
    them, S_j^-1 = C_j^-1 - C_0^-1, make the normal likelihood: exact where it is normal, as it is of coordinates that
    the data tell well. Raises `SettingsError` for runs of different materials or of the same readings, and for
    coordinates that one of them lacks.
    """
    if not runs:
        raise SettingsError("there is no run to make a population of", remedy="name at least two")
    material = runs[0].hypothesis.material
    for run in runs:
        if run.hypothesis.material is not material:
            raise SettingsError(
                f"the runs have different materials, {material.name} and {run.hypothesis.material.name}",
                run.name,
                "make a population of one material",
            )
    _each_once(runs)
    own = (LN_MODULUS, *(p.name for p in material.coordinates[1:]))
    names = tuple(pool) or own
    full = [_full(name, material.name, own) for name in names]
    found = [_likelihood(run, full) for run in runs]
    labels = labelled([("", run.measurement) for run in runs])
    parameters = {p.name: p for p in runs[0].hypothesis.parameters}
    priors = np.array([parameters[n].prior.mean_sd for n in full])
    # The prior of the material is on G d: that of the population's G is centred at the mean thickness.
    mean_log = float(np.mean([np.log(run.measurement.specimen.thickness) for run in runs]))
    shift = np.array([mean_log if name == LN_MODULUS else 0.0 for name in names])
    return Specimens(
        labels=tuple(labels),
        names=names,
        values=np.array([f[0] for f in found]),
        covariances=np.array([f[1] for f in found]),
        centre=priors[:, 0] - shift,
        spread=priors[:, 1],
        skewed=tuple(label for label, f in zip(labels, found, strict=True) if f[2] > SKEWED),
    )


def _each_once(runs: Sequence[Run]) -> None:
    seen = [run.measurement.data_hash for run in runs]
    for number, (run, own) in enumerate(zip(runs, seen, strict=True)):
        if own in seen[:number]:
            raise SettingsError(
                f"{runs[seen.index(own)].name} and {run.name} are of the same readings: one specimen would be two",
                remedy="name one run for each specimen",
            )


def _full(name: str, material: str, own: Sequence[str]) -> str:
    """The coordinate of a hypothesis that is meant."""
    if name == LN_MODULUS:
        return f"{material}.ln_gd"
    return f"{material}.{name}" if name in own else name


def _likelihood(run: Run, full: Sequence[str]) -> tuple[Array, Array, float]:
    """(mean (q,), covariance (q, q)) of the normal likelihood of one run, and the largest skewness of its draws."""
    names = run.hypothesis.names
    for name in full:
        if name not in names:
            raise unknown_name(f'coordinate of the run "{run.name}"', name, names)
    at = [names.index(name) for name in full]
    x = run.draws()[:, at].copy()
    for i, name in enumerate(full):
        if name.endswith(".ln_gd"):
            x[:, i] -= np.log(run.measurement.specimen.thickness)
    mean, covariance = np.mean(x, axis=0), np.atleast_2d(np.cov(x.T))
    centre, spread = np.array([run.hypothesis.parameters[i].prior.mean_sd for i in at]).T
    before = spread**-2
    for i, name in enumerate(full):
        if name.endswith(".ln_gd"):
            centre[i] -= np.log(run.measurement.specimen.thickness)
    after = np.linalg.inv(covariance)
    values, vectors = eigh((after - np.diag(before)) / np.sqrt(np.outer(before, before)))
    root = np.sqrt(before)
    precision = root[:, None] * (vectors * np.maximum(values, FLAT)) @ vectors.T * root
    value = np.linalg.solve(precision, after @ mean - before * centre)
    skew = np.abs(np.mean(((x - mean) / np.std(x, axis=0)) ** 3, axis=0))
    return value, np.linalg.inv(precision), float(np.max(skew))
