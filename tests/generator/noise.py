"""What the load cell adds at random: white or first-order autoregressive noise, and rounding."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tests.generator.energies import Array


@dataclass(frozen=True)
class Noise:
    """Noise of the force: standard deviation (N), correlation of neighbours, step of rounding (N), uneven sampling.

    relative : ``sd`` and ``quantum`` are parts of the largest force of the film, see `at`
    grows : at the largest deflection the deviation is sqrt(1 + grows^2) times ``sd``
    """

    sd: float = 0.004
    rho: float = 0.0
    quantum: float = 0.0
    uneven: bool = False
    relative: bool = False
    grows: float = 0.0

    @classmethod
    def named(cls, text: str) -> Noise:
        """From words joined by "+": white, ar1 (rho 0.5), ar1:RHO, quantised (1 sd), uneven, sd:NEWTON, grows:TIMES."""
        settings: dict[str, float | bool] = {}
        for word in text.split("+"):
            key, _, value = word.partition(":")
            if key == "ar1":
                settings["rho"] = float(value or 0.5)
            elif key == "quantised":
                settings["quantum"] = float(value or 0.004)
            elif key == "uneven":
                settings["uneven"] = True
            elif key in ("sd", "grows"):
                settings[key] = float(value)
            elif key != "white":
                raise ValueError(f"there is no noise {word!r}")
        return cls(**settings)  # type: ignore[arg-type]

    def at(self, largest_force: float) -> Noise:
        """In N, for a film that carries so much (N)."""
        if not self.relative:
            return self
        return replace(self, sd=self.sd * largest_force, quantum=self.quantum * largest_force, relative=False)

    def deviations(self, deflection: Array) -> Array:
        """(N,) N at deflections (N,) m."""
        return self.sd * np.sqrt(1 + (self.grows * (deflection / np.max(deflection)) ** 1.5) ** 2)

    def draw(self, rng: np.random.Generator, deflection: Array) -> Array:
        """(N,) N at deflections (N,) m, before rounding."""
        size = deflection.size
        white = rng.standard_normal(size)
        out = np.empty(size)
        out[0] = white[0]
        for i in range(1, size):
            out[i] = self.rho * out[i - 1] + np.sqrt(1 - self.rho**2) * white[i]
        return self.deviations(deflection) * out

    def rounded(self, force: Array) -> Array:
        """``force`` as the instrument writes it."""
        return np.round(force / self.quantum) * self.quantum if self.quantum else force

    def covariance(self, deflection: Array) -> Array:
        """(N, N) N^2 at deflections (N,) m; rounding counts as a white part of variance quantum^2 / 12."""
        size, growth = deflection.size, self.deviations(deflection) / self.sd
        lag = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
        return self.sd**2 * self.rho**lag * (growth[:, None] * growth) + np.eye(size) * self.quantum**2 / 12
