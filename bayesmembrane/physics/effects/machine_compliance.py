"""Frame, load cell and grips yield: the film gets less than the crosshead's travel."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar, Self

import numpy as np
from scipy.optimize import least_squares

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.parameters import Array, Lomax, Normal
from bayesmembrane.physics.effects.base import Compliance, EffectParameter

NEWTON = 1.0  # N: the force at which the compliance is what its name says, whatever the exponent
SMALLEST = 1e-9  # N: below it a power less than one has no slope
REPEATED = 0.01
"""Relative: no better does a frame yield as it did in its blank run, for a film is clamped in between."""
BENT = 0.3
"""Standard deviation of the part by which the compliance changes over a test beyond what its exponent says."""
LEAST_BENT = -0.25
"""Of that part: a frame that yields less the larger the force is none."""
REFITS = 20
FAR = 4.0
"""Standard deviations: farther from what the blank run says no frame is looked for."""
REMEMBERS_AT_MOST = 0.98
"""Correlation of neighbouring residuals of a blank run."""


@dataclass(frozen=True)
class FrameCurve:
    """What a blank run says of a frame: ``compliance`` +- ``sd`` m/N, and the shape of its curve.

    It yields by compliance F |F / 1 N|^(exponent - 1) (1 + bend |F|), bend in 1/N.
    """

    compliance: float
    sd: float
    exponent: float
    bend: float


@dataclass(frozen=True)
class MachineCompliance(Compliance):
    """delta_film = delta - compliance F |F / 1 N|^(exponent - 1).

    Beams and load cells yield in proportion to the force (1), contacts of round bodies as F^(2/3) (H. Hertz, J. Reine
    Angew. Math. 92 (1882) 156), rough seats, whose stiffness grows with the force, more nearly as its logarithm, joints
    that open the other way round: the compliance of real frames changes with the load, by tens of percents. And frames
    differ by orders of magnitude: a prior that falls like a normal one would rather let the film be softer than the
    frame.

    Where ``blank`` is what a blank run says, the compliance is known but for its sd, and the shape is the run's.
    """

    blank: FrameCurve | None = None

    name: ClassVar[str] = "machine_compliance"
    title: ClassVar[str] = "compliance of the machine"
    reference: ClassVar[str] = "S. R. Kalidindi, A. Abusafieh, E. El-Danaf, Exp. Mech. 37 (1997) 210"
    signature: ClassVar[str] = (
        "Too soft where the force is high: the residual follows force times slope, alike on all legs, and a blank run "
        "shows it."
    )
    remembers: ClassVar[bool] = False
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("compliance", "m/N", "travel lost by the first newton", Lomax(5e-4), (0.0, 1e-2), 0.0),
        EffectParameter("exponent", "-", "of the force that the travel lost grows with", Normal(0.8, 0.16), (0.3, 1.4)),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.blank is not None:
            own = {"coordinates": (_known(self.blank),), "title": "the frame of its blank run", "exact": True}
            for name, value in own.items():
                object.__setattr__(self, name, value)

    def shown_by(self, measurement: Measurement) -> Self:
        if measurement.blank is None:
            return self
        reached = float(np.max(np.abs(measurement.force)))
        return replace(self, blank=_curve_of(measurement.blank.tobytes(), reached))

    def yielding(self, p: Array, force: Array) -> tuple[Array, Array]:
        size = np.maximum(np.abs(force), SMALLEST)
        if self.blank is None:
            secant = p[:, :1] * (size / NEWTON) ** (p[:, 1:2] - 1)
            return secant * force, p[:, 1:2] * secant
        secant, bent = p[:, :1] * (size / NEWTON) ** (self.blank.exponent - 1), self.blank.bend * size
        return secant * (1 + bent) * force, secant * (self.blank.exponent * (1 + bent) + bent)


def _known(blank: FrameCurve) -> EffectParameter:
    """The compliance of a frame that was measured: no size that may be nothing, but a value with its error."""
    declared = MachineCompliance.coordinates[0]
    wide = (max(blank.compliance - FAR * blank.sd, 0.0), blank.compliance + FAR * blank.sd)
    return replace(declared, prior=Normal(blank.compliance, blank.sd), bounds=wide, null=None)


@lru_cache(maxsize=64)
def _curve_of(run: bytes, reached: float) -> FrameCurve:
    """From a blank run (M, 2), m and N, as bytes: least squares of

        delta = delta_0 + lost y^exponent (1 + bend y) / (1 + bend),    y = F / reached.

    ``reached`` N, the largest force of the test, is where the error counts. It is that of the scatter about the law,
    neighbours of which are correlated (a frame that has play, or yields another way back), with priors of the exponent
    and of the bend, and at least `REPEATED`.
    """
    travel, force = np.frombuffer(run).reshape(-1, 2).T
    part, usual = force / reached, MachineCompliance.coordinates[1]
    middle, spread = usual.prior.mean_sd
    slope, start = np.polyfit(part, travel, 1)

    def off(p: Array, sd: float) -> Array:
        way = np.sign(part) * np.abs(part) ** p[2] * (1 + p[3] * np.abs(part)) / (1 + p[3])
        return np.append((p[0] + p[1] * way - travel) / sd, [(p[2] - middle) / spread, p[3] / BENT])

    sd = lost = max(float(slope), 1e-15)
    ends = ([-np.inf, 0.0, usual.bounds[0], LEAST_BENT], [np.inf, np.inf, usual.bounds[1], 4 * BENT])
    p, scale = np.array([start, lost, middle, 0.0]), np.array([lost, lost, 1.0, 1.0])
    for _ in range(REFITS):  # the scatter is that of the fit, and how much the priors of the shape count hangs on it
        found = least_squares(off, p, bounds=ends, args=(sd,), x_scale=scale)
        p, rest = found.x, off(found.x, 1.0)[:-2]
        sd = max(float(np.sqrt(rest @ rest / max(rest.size - 4, 1))), 1e-9 * p[1], 1e-15)
    rho = min(max(float(rest[1:] @ rest[:-1]) / max(float(rest @ rest), 1e-300), 0.0), REMEMBERS_AT_MOST)
    slopes = np.asarray(found.jac)
    lost_sd = float(np.sqrt(np.linalg.inv(slopes.T @ slopes)[1, 1] * (1 + rho) / (1 - rho)))
    at_first = (NEWTON / reached) ** p[2] / (1 + p[3])
    lost_sd = float(np.hypot(lost_sd, REPEATED * p[1]))
    return FrameCurve(float(p[1] * at_first), lost_sd * float(at_first), float(p[2]), float(p[3]) / reached)
