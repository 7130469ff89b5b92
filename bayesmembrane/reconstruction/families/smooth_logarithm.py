"""A curve that is smooth in the logarithm of its force over a simulated one."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from bayesmembrane.ground.parameters import Array
from bayesmembrane.reconstruction.families.base import CurveFamily
from bayesmembrane.reconstruction.families.wiener import wiener_basis
from bayesmembrane.reconstruction.simulations import Simulations

LINE = (1.0, 0.3)  # prior standard deviations of u: level, and slope per 10 mm


class SmoothLogarithm(CurveFamily):
    """g = F_0(x) exp(u(x)): F_0 is the simulated curve of the first row, u a line plus an integrated Wiener process.

    The size is the standard deviation of that process after 10 mm, times sqrt(3).
    """

    name = "smooth_logarithm"
    title = "smooth logarithm of the force over a neo-Hookean one"

    def __init__(self, simulations: Simulations) -> None:
        self.simulations = simulations

    @cached_property
    def _basis(self) -> CubicSpline:
        return wiener_basis(float(max(self.simulations.ends)), LINE)

    @property
    def sizes(self) -> tuple[float, ...]:
        return (0.07, 0.14, 0.28, 0.56)

    @property
    def middle(self) -> float:
        return 0.14

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
        reference, slope = self.simulations.reference_force(x)
        force = reference * np.exp(np.einsum("bnj,bj->bn", shape, scaled))
        du = np.einsum("bnj,bj->bn", self._basis(x, 1), scaled)
        shape[:, :, self.free] *= size[:, None, None]
        return force, force * (slope / reference + du), force[:, :, None] * shape
