"""The height of a lifted film over the radius, h(r), at one deflection of the disc, for traced contours.

The shape depends on the energy, not on its modulus: h of films with s W is that of films with W.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics.profile import profiles
from bayesmembrane.physics.mechanics.request import request
from bayesmembrane.physics.mechanics.solution import Curves, Profile, Status

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

POINTS = 201
FARTHER = 1e3
"""How much farther than asked a film is varied, for a difference that is no round-off."""


@dataclass(frozen=True)
class ContourLaw:
    """h(r) of B films.

    material, parameters : the films (B, n)
    lift : m, deflection of the disc
    inner_radius, outer_radius : m
    change : (B, n) by which the parameters differ to first order, or None
    """

    material: type[Material]
    parameters: Array
    lift: float
    inner_radius: float
    outer_radius: float
    change: Array | None = None

    @property
    def status(self) -> NDArray[np.int8]:
        """(B,) `Status` of the films at this deflection."""
        return np.array([status for status, _ in self._shapes], dtype=np.int8)

    def __call__(self, radius: Array, excess: Array | None = None) -> tuple[Array, Array]:
        """((B, N) m, (B, N)): height and dh/dr at radii (B, N) m, off the film that at its edge; nan without one."""
        if self.change is None:
            return self._heights(radius)
        middle, slope = self._plain._heights(radius)
        far = FARTHER * self.change
        ends = [replace(self._plain, parameters=self.parameters + s * far)._heights(radius)[0] for s in (1, -1)]
        return middle + (ends[0] - ends[1]) / (2 * FARTHER), slope

    def varied(self, change: Array) -> ContourLaw:
        """The law of films whose parameters differ by ``change`` (B, n), to first order."""
        return replace(self, change=change)

    def of(self, rows: NDArray[np.intp] | slice) -> ContourLaw:
        """The law of some of the films."""
        change = None if self.change is None else self.change[rows]
        return replace(self, parameters=self.parameters[rows], change=change)

    @staticmethod
    def stack(laws: Sequence[ContourLaw]) -> ContourLaw:
        """The films of all laws, one after the other."""
        parameters = np.concatenate([law.parameters for law in laws])
        if all(law.change is None for law in laws):
            return replace(laws[0], parameters=parameters)
        changes = [0.0 * law.parameters if law.change is None else law.change for law in laws]
        return replace(laws[0], parameters=parameters, change=np.concatenate(changes))

    @cached_property
    def _plain(self) -> ContourLaw:
        return replace(self, change=None)

    @cached_property
    def _shapes(self) -> list[tuple[Status, PchipInterpolator | None]]:
        radii = self.inner_radius, self.outer_radius
        asked = request(self.material, self.parameters, [self.lift], *radii)
        return [_shape(p) for p in profiles(asked, POINTS)]

    def _heights(self, radius: Array) -> tuple[Array, Array]:
        height, slope = np.full(radius.shape, np.nan), np.full(radius.shape, np.nan)
        for b, (_, shape) in enumerate(self._shapes):
            if shape is not None:
                at = np.clip(radius[b], shape.x[0], shape.x[-1])
                height[b], slope[b] = shape(at), shape(at, 1)
        return height, slope


def _shape(found: Profile) -> tuple[Status, PchipInterpolator | None]:
    """h(r) of one film, where it has a state."""
    if found.status is not Status.OK:
        return found.status, None
    from scipy.interpolate import PchipInterpolator  # on demand: all rigs are looked at by every command

    seen = _seen(found.f)
    return Status.OK, PchipInterpolator(found.f[seen], found.height[seen])


def _seen(radius: Array) -> NDArray[np.intp]:
    """Which points of a film, at radii (M,) from the disc down to the clamp, are seen from above and without the neck.

    Lifted far, some films are narrowest below the disc, and some hang over what lies below them: there is one height at
    each radius, the highest outside of the neck.
    """
    neck = int(np.argmin(radius))
    farthest = np.maximum.accumulate(radius[neck:])
    return neck + np.flatnonzero(np.diff(farthest, prepend=-np.inf) > 0)


def contour_curves(law: ContourLaw, margins: Curves, radius: Array, sensitivities: bool = False) -> Curves:
    """Heights in the place of forces, at radii (N,) m; ``margins`` are of the same films at the lift (B, 1)."""
    r = np.broadcast_to(radius, (len(law.parameters), radius.size))
    height, slope = law(r)
    status = np.broadcast_to(law.status[:, None], r.shape)
    names = ("convexity", "ellipticity", "max_stretch", "energy")
    wide = {name: np.broadcast_to(getattr(margins, name)[:, :1], r.shape) for name in names}
    return Curves(
        deflection=r,
        force=height,
        status=status,
        note=np.zeros(r.shape, np.int8),
        slope=slope,
        sensitivity=_sensitivity(law, r, height) if sensitivities else None,
        variation=np.zeros(r.shape),
        **wide,
    )


def _sensitivity(law: ContourLaw, radius: Array, height: Array) -> Array:
    """(B, N, n) dh/dp by central differences."""
    scales = np.asarray(law.material.scales) == 1
    gd = np.abs(np.asarray(law.material.shear_modulus(law.parameters.T)))
    out = []
    for i in range(law.parameters.shape[1]):
        step = 1e-6 * (gd if scales[i] else np.maximum(np.abs(law.parameters[:, i]), 1.0))
        change = np.zeros(law.parameters.shape)
        change[:, i] = step
        out.append((law.varied(change)(radius)[0] - height) / step[:, None])
    return np.stack(out, axis=2)
