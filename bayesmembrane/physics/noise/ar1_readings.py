"""Noise that remembers by the reading: averages and filters of so many readings, however fast the disc moved."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.physics.noise.ar1 import AR1, AR1Likelihood, gaps_of


@dataclass(frozen=True)
class AR1Readings(AR1):
    """Sigma_ij = Sigma_given_ij + tau^2 rho^|i - j| of readings i and j: `AR1` with the reading as its clock."""

    name: ClassVar[str] = "ar1_readings"
    title: ClassVar[str] = "noise that remembers by the reading, AR(1)"

    def bind(self, measurement: Measurement) -> AR1Likelihood:
        return AR1Likelihood(measurement, gaps_of(measurement, "readings"))
