"""Functions that span a smooth unknown curve: a straight line and an integrated Wiener process."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline

from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.symmetric import eigh
from bayesmembrane.reconstruction.families.base import CurveFamily
from bayesmembrane.reconstruction.simulations import Simulations

LENGTH = 0.010  # m, unit of deflection
MODES = 20  # of the integrated Wiener process: the next one moves the curve by less than 1e-3 of the first
NODES = 1201


def wiener_basis(top: float, line: tuple[float, float], rate: Callable[[Array], Array] | None = None) -> CubicSpline:
    """Functions on [0, top] (m): level and slope of the sizes ``line``, and `MODES` of an integrated Wiener process.

    k(a, b) = int_0^min(a, b) rate(t)^2 (a - t) (b - t) dt in units of 10 mm; for rate 1 that is
    a^2 (3 b - a) / 6 with a <= b. Each mode has the size that it has for roughness 1.
    """
    x = np.linspace(0.0, top, NODES)
    s = x / LENGTH
    if rate is None:
        low, high = np.minimum(s[:, None], s), np.maximum(s[:, None], s)
        kernel = low**2 * (3 * high - low) / 6
    else:
        middle = 0.5 * (s[1:] + s[:-1])
        ramp = np.maximum(s[:, None] - middle, 0.0) * rate(LENGTH * middle) * np.sqrt(s[1])
        kernel = ramp @ ramp.T
    sizes, modes = eigh(kernel)
    modes = modes[:, ::-1][:, :MODES] * np.sqrt(sizes[::-1][:MODES])
    modes = modes * np.sign(modes[-1])
    return CubicSpline(x, np.column_stack([np.full(x.size, line[0]), line[1] * s, modes]))


class Spanned(CurveFamily):
    """A family whose unknowns are the line and the modes of a `wiener_basis`; the modes are what is free."""

    def __init__(self, simulations: Simulations) -> None:
        self.simulations = simulations

    @property
    @abstractmethod
    def _basis(self) -> CubicSpline: ...

    @property
    def size(self) -> int:
        return int(self._basis.c.shape[-1])

    @property
    def free(self) -> slice:
        return slice(2, self.size)

    def spanned(self, c: Array, size: Array, x: Array) -> tuple[Array, Array, Array]:
        """u (B, N) of unknowns c (B, J) with sizes (B,) at x (B, N) in m, du/dx (B, N) and du/dc (B, N, J)."""
        scaled = c.copy()
        scaled[:, self.free] *= size[:, None]
        shape = self._basis(x)
        u, du = (np.einsum("bnj,bj->bn", v, scaled) for v in (shape, self._basis(x, 1)))
        shape[:, :, self.free] *= size[:, None, None]
        return u, du, shape
