"""The simulated curves of all rows of a published table, tabulated once.

Everything that follows asks them at many deflections that are not known beforehand.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from bayesmembrane.data.published import PublishedTable
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array

Simulate = Callable[[str, Sequence[float], Array], Array]
"""(material, parameters, deflection (N,) in m) -> force (N,) in N, nan where there is none."""

STEP = 0.25e-3  # m between the tabulated forces
NEAREST = 0.05e-3  # m: closer to zero no force can be told from none
SAME = 1e-6  # curves whose ratio is constant to this are one curve up to a factor


@dataclass(frozen=True)
class Simulations:
    """The simulated curves of all rows as splines: ln F_0 in ln x, ln(F_k / F_0) in x.

    Attributes
    ----------
    usable : (K,) False where the forward model has no curve for a row
    material : (K,) number of the material
    family : (K,) number of the family of curves that are equal up to a factor, -1 for a curve of its own
    ends : (R,) m, last deflection of each range
    typical : (R,) N, median force at the ends
    """

    reference: CubicSpline
    ratios: CubicSpline
    usable: NDArray[np.bool_]
    material: NDArray[np.intp]
    family: NDArray[np.intp]
    ends: Array
    typical: Array

    def reference_force(self, x: Array) -> tuple[Array, Array]:
        """F_0 and dF_0/dx at deflections x in m, both of its shape; below 0.05 mm as at 0.05 mm."""
        x = np.maximum(x, NEAREST)
        log_x = np.log(x)
        force = np.exp(self.reference(log_x))
        return force, force * self.reference(log_x, 1) / x

    def forces(self, x: Array) -> tuple[Array, Array]:
        """F (..., K) of all rows and dF/dx (..., K) at deflections x (...) in m; below 0.05 mm as at 0.05 mm."""
        reference, slope = self.reference_force(x)
        x = np.maximum(x, NEAREST)
        force = reference[..., None] * np.exp(self.ratios(x))
        return force, force * ((slope / reference)[..., None] + self.ratios(x, 1))


def tabulate(table: PublishedTable, simulate: Simulate) -> Simulations:
    """Simulate every row once on a fine grid up to the largest end.

    Raises `DataError` if the first row has no curve there: the others are told relative to it.
    """
    top = max(table.ends)
    x = np.concatenate([[NEAREST, 0.1e-3, 0.15e-3, 0.2e-3], np.arange(STEP, top, STEP), [top]])
    force = np.array([simulate(row.material, row.values, x) for row in table.rows])
    usable = np.all(np.isfinite(force) & (force > 0), axis=1)
    if not usable[0]:
        raise DataError(
            "the forward model gives no force over the whole range", table.rows[0].label, "put another row first"
        )
    logs = np.log(np.where(usable[:, None], force, force[0]))
    ratios = logs - logs[0]
    ends = np.array(table.ends)
    at_ends = np.array([np.interp(ends, x, f) for f in force[usable]])
    return Simulations(
        CubicSpline(np.log(x), logs[0]),
        CubicSpline(x, ratios.T),
        usable,
        np.unique([row.material for row in table.rows], return_inverse=True)[1].astype(np.intp),
        _families(ratios, usable),
        ends,
        np.median(at_ends, axis=0),
    )


def _families(ratios: Array, usable: NDArray[np.bool_]) -> NDArray[np.intp]:
    family = np.full(usable.size, -1, dtype=np.intp)
    count = 0
    for k in np.flatnonzero(usable):
        alike = usable & (np.ptp(ratios - ratios[k], axis=1) < SAME) & (family < 0)
        if np.count_nonzero(alike) > 1:
            family[alike] = count
            count += 1
    return family
