"""A curve that is smooth in its force."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from bayesmembrane.ground.parameters import Array
from bayesmembrane.reconstruction.families.wiener import LENGTH, Spanned, wiener_basis

LEVEL = 0.05  # N, prior standard deviation of the force at zero


class SmoothForce(Spanned):
    """g = a line plus an integrated Wiener process; nothing is known at zero, neither its place nor a cubic start.

    The slope changes in proportion to a typical one: root mean square of the slopes of the simulated curves, the
    largest up to x, not less than over the shortest range. The size is the standard deviation of the change of slope
    over 10 mm relative to it.
    """

    name = "smooth_force"
    title = "smooth force"

    @cached_property
    def _basis(self) -> CubicSpline:
        ends = self.simulations.ends
        x = np.linspace(0.0, float(max(ends)), 400)
        slopes = self.simulations.forces(x)[1][:, self.simulations.usable]
        typical = LENGTH * np.maximum.accumulate(np.sqrt(np.mean(slopes**2, axis=1)))
        least = float(np.interp(min(ends), x, typical))
        rate = np.maximum(typical, least)
        return wiener_basis(float(max(ends)), (LEVEL, least), lambda t: np.interp(t, x, rate))

    @property
    def sizes(self) -> tuple[float, ...]:
        return (0.2, 0.4, 0.8, 1.6)

    @property
    def middle(self) -> float:
        return 0.4

    def force(self, c: Array, size: Array, x: Array) -> tuple[Array, Array, Array]:
        return self.spanned(c, size, x)

    def stride(self, moved: Array, force: Array, step: Array) -> float:
        """All of it: the forces are linear in the unknowns."""
        return 1.0
