"""A curve that is smooth in its force."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from bayesmembrane.ground.parameters import Array
from bayesmembrane.reconstruction.families.base import CurveFamily
from bayesmembrane.reconstruction.families.wiener import LENGTH, wiener_basis
from bayesmembrane.reconstruction.simulations import Simulations

LEVEL = 0.05  # N, prior standard deviation of the force at zero


class SmoothForce(CurveFamily):
    """g = a line plus an integrated Wiener process; nothing is known at zero, neither its place nor a cubic start.

    The slope changes in proportion to a typical one: root mean square of the slopes of the simulated curves, the
    largest up to x, not less than over the shortest range. The size is the standard deviation of the change of slope
    over 10 mm relative to it.
    """

    name = "smooth_force"
    title = "smooth force"

    def __init__(self, simulations: Simulations) -> None:
        self.simulations = simulations

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

    @property
    def size(self) -> int:
        return int(self._basis.c.shape[-1])

    @property
    def free(self) -> slice:
        return slice(2, self.size)

    def force(self, c: Array, size: Array, x: Array) -> tuple[Array, Array, Array]:
        scaled = c.copy()
        scaled[:, self.free] *= size[:, None]
        shape = self._basis(x)
        force = np.einsum("bnj,bj->bn", shape, scaled)
        slope = np.einsum("bnj,bj->bn", self._basis(x, 1), scaled)
        shape[:, :, self.free] *= size[:, None, None]
        return force, slope, shape

    def stride(self, moved: Array, force: Array, step: Array) -> float:
        """All of it: the forces are linear in the unknowns."""
        return 1.0
