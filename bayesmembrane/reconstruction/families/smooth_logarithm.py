"""A curve that is smooth in the logarithm of its force over a simulated one."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from bayesmembrane.ground.parameters import Array
from bayesmembrane.reconstruction.families.wiener import Spanned, wiener_basis

LINE = (1.0, 0.3)  # prior standard deviations of u: level, and slope per 10 mm


class SmoothLogarithm(Spanned):
    """g = F_0(x) exp(u(x)): F_0 is the simulated curve of the first row, u a line plus an integrated Wiener process.

    The size is the standard deviation of that process after 10 mm, times sqrt(3).
    """

    name = "smooth_logarithm"
    title = "smooth logarithm of the force over a neo-Hookean one"

    @cached_property
    def _basis(self) -> CubicSpline:
        return wiener_basis(float(max(self.simulations.ends)), LINE)

    @property
    def sizes(self) -> tuple[float, ...]:
        return (0.07, 0.14, 0.28, 0.56)

    @property
    def middle(self) -> float:
        return 0.14

    def force(self, c: Array, size: Array, x: Array) -> tuple[Array, Array, Array]:
        u, du, moved = self.spanned(c, size, x)
        reference, slope = self.simulations.reference_force(x)
        force = reference * np.exp(u)
        return force, force * (slope / reference + du), force[:, :, None] * moved
