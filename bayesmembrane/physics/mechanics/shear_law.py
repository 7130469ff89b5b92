"""The law of simple shear in closed form: F = width dW/dg with W(l(g), 1) and l = g / 2 + sqrt(1 + g^2 / 4).

The amount of shear g stretches one direction of the plane to l, the other to 1 / l and leaves the third: the state of a
planar test, turned (R. W. Ogden, Non-Linear Elastic Deformations, 1984, 2.2.6). The energy of an incompressible
isotropic solid does not care how its axes are numbered.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics.convexity import least_eigenvalue
from bayesmembrane.physics.mechanics.solution import Curves, Status
from bayesmembrane.physics.mechanics.strip_law import once


@dataclass(frozen=True)
class ShearLaw:
    """F(delta) of B specimens with the shear g = delta / length.

    material, parameters : the films (B, n)
    length, width : m
    """

    material: type[Material]
    parameters: Array
    length: float
    width: float

    @property
    def status(self) -> NDArray[np.int8]:
        """(B,) `Status` where there is no force: the chains are stretched out."""
        return np.full(len(self.parameters), Status.LOCKED, np.int8)

    def __call__(self, deflection: Array, excess: Array | None = None) -> tuple[Array, Array]:
        """((B, N) N, (B, N) N/m): force and dF/d(delta) at deflections (B, N) m; nan where there is none.

        With ``excess`` e (B, N) the specimen is at rest at a shear of e.
        """
        shear = (once(deflection) if excess is None else deflection) / self.length
        shear = shear if excess is None else shear - excess
        stretch, rate, bend = stretched(shear)
        with np.errstate(all="ignore"):
            _, w1, _, w11, _, _ = self.material.derivatives(self.parameters.T[:, :, None], stretch, 1.0 + 0.0 * stretch)
            w1 = np.where(np.isfinite(w1), w1, np.nan)
            slope = self.width / self.length * (w11 * rate * rate + w1 * bend)
        return self.width * np.sign(shear) * w1 * rate, np.where(np.isnan(w1), w1, slope)

    def varied(self, change: Array) -> ShearLaw:
        """The law of specimens whose parameters differ by ``change`` (B, n)."""
        return replace(self, parameters=self.parameters + change)

    def of(self, rows: NDArray[np.intp] | slice) -> ShearLaw:
        """The law of some of the specimens."""
        return replace(self, parameters=self.parameters[rows])

    @staticmethod
    def stack(laws: Sequence[ShearLaw]) -> ShearLaw:
        """The specimens of all laws, one after the other."""
        return replace(laws[0], parameters=np.concatenate([law.parameters for law in laws]))


def stretched(shear: Array) -> tuple[Array, Array, Array]:
    """(l, dl/d|g|, d2l/dg2) of shears g; l >= 1 is the larger in-plane stretch: l - 1 / l = |g|."""
    half = 0.5 * np.abs(shear)
    root = np.sqrt(1.0 + half * half)
    stretch = half + root
    return stretch, 0.5 * stretch / root, 0.25 / root**3


def shear_curves(law: ShearLaw, deflection: Array, sensitivities: bool = False) -> Curves:
    """Curves of the specimens of ``law`` at ``deflection`` (N,) m; convexity is that at (l, 1)."""
    d = np.broadcast_to(deflection, (len(law.parameters), deflection.size))
    force, slope = law(d)
    shear = deflection[None, :] / law.length  # (1, N): kinematics are those of all specimens
    stretch, rate, _ = stretched(shear)
    one, rates = np.ones_like(stretch), None
    p = law.parameters.T[:, :, None]
    with np.errstate(all="ignore"):
        w, _, _, a, b, c = law.material.derivatives(p, stretch, one)
        if sensitivities:
            each = [s[1] + np.zeros(d.shape) for s in law.material.sensitivities(p, stretch, one)]
            rates = (law.width * np.sign(shear) * rate)[:, :, None] * np.stack(each, axis=2)
        gd = np.abs(np.asarray(law.material.shear_modulus(law.parameters.T)))[:, None]
    return Curves(
        deflection=d,
        force=force,
        status=np.where(np.isfinite(force), Status.OK, Status.LOCKED).astype(np.int8),
        note=np.zeros(d.shape, np.int8),
        slope=slope,
        sensitivity=rates,
        variation=np.zeros(d.shape),
        max_stretch=np.broadcast_to(stretch, d.shape),
        ellipticity=np.asarray(np.minimum(a, c) / gd),
        convexity=np.asarray(least_eigenvalue(a, b, c) / gd),
        energy=w * law.width * law.length + np.zeros(d.shape),
    )
