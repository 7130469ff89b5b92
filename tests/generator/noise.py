"""What the load cell adds at random: white or first-order autoregressive noise, and rounding."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.generator.energies import Array


@dataclass(frozen=True)
class Noise:
    """Noise of the force: standard deviation (N), correlation of neighbours, step of rounding (N), uneven sampling."""

    sd: float = 0.004
    rho: float = 0.0
    quantum: float = 0.0
    uneven: bool = False

    @classmethod
    def named(cls, text: str) -> Noise:
        """From words joined by "+": white, ar1 (rho 0.5), ar1:RHO, quantised (1 sd), uneven, sd:NEWTON."""
        settings: dict[str, float | bool] = {}
        for word in text.split("+"):
            key, _, value = word.partition(":")
            if key == "ar1":
                settings["rho"] = float(value or 0.5)
            elif key == "quantised":
                settings["quantum"] = float(value or 0.004)
            elif key == "uneven":
                settings["uneven"] = True
            elif key == "sd":
                settings["sd"] = float(value)
            elif key != "white":
                raise ValueError(f"there is no noise {word!r}")
        return cls(**settings)  # type: ignore[arg-type]

    def draw(self, rng: np.random.Generator, size: int) -> Array:
        """(size,) N, stationary, before rounding."""
        white = rng.standard_normal(size)
        out = np.empty(size)
        out[0] = white[0]
        for i in range(1, size):
            out[i] = self.rho * out[i - 1] + np.sqrt(1 - self.rho**2) * white[i]
        return self.sd * out

    def rounded(self, force: Array) -> Array:
        """``force`` as the instrument writes it."""
        return np.round(force / self.quantum) * self.quantum if self.quantum else force

    def covariance(self, size: int) -> Array:
        """(size, size) N^2; rounding counts as a white part of variance quantum^2 / 12."""
        lag = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
        return self.sd**2 * self.rho**lag + np.eye(size) * self.quantum**2 / 12
