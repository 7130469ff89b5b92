"""The law of a homogeneous test, in closed form: F = width P1(l, l2(l)) with l = 1 + delta / L.

A thin film bears no compression. Where both stretches are measured, that is a matter of stress, not of stretch: held
across at l2, a film is taut along down to l = l2^(-1/2), where P1(l, l2) falls to zero, though l is below 1 there.
Below, it wrinkles. This is tension-field theory (A. C. Pipkin, IMA J. Appl. Math. 36 (1986) 85) of an incompressible
film whose energy obeys the Baker-Ericksen inequality: P1 > 0 where l > l3 = 1 / (l l2), whatever the energy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics.convexity import least_eigenvalue
from bayesmembrane.physics.mechanics.solution import Curves, Note, Status


class Pulled(Protocol):
    """What a rig tells of a homogeneous test; see `rigs.base.Strip`."""

    @property
    def length(self) -> float: ...
    @property
    def width(self) -> float: ...
    def lateral(self, stretch: Array, across: Array | None = None) -> tuple[Array, Array]:
        """(l2, dl2/dl) at stretches l (B, N); ``across`` (N,) is l2 where it was measured."""


@dataclass(frozen=True)
class StripLaw:
    """F(delta) of B films.

    material, parameters : the films (B, n)
    rig : length, width and lateral stretch
    pushes : True if the specimen bears compression; else it is slack there
    across : (N,) stretch across the pull where it was measured, or None
    """

    material: type[Material]
    parameters: Array
    rig: Pulled
    pushes: bool = False
    across: Array | None = None

    @property
    def status(self) -> NDArray[np.int8]:
        """(B,) `Status` where there is no force: the chains are stretched out."""
        return np.full(len(self.parameters), Status.LOCKED, np.int8)

    def __call__(self, deflection: Array, excess: Array | None = None) -> tuple[Array, Array]:
        """((B, N) N, (B, N) N/m): force and dF/d(delta) at deflections (B, N) m; nan where there is none.

        With ``excess`` e (B, N) the strip is longer by that part: l = (1 + delta / L) / (1 + e).
        """
        longer = 1.0 if excess is None else 1.0 + excess
        stretch = (1.0 + (once(deflection) if excess is None else deflection) / self.rig.length) / longer
        pulled, l2, dl2 = self.taut(stretch)
        width = self.rig.width
        with np.errstate(all="ignore"):
            # Kinematics (1, N) are those of all films; the energies' slopes are (B, N).
            _, p1, _, p11, p12, _ = self.material.derivatives(self.parameters.T[:, :, None], pulled, l2)
            p1 = np.where(np.isfinite(p1), p1, np.nan)  # beyond all numbers there is no force
            slope = width * (p11 + p12 * dl2) / (self.rig.length * longer)
        force = np.where(pulled == stretch, width * p1, 0.0 * p1)
        slope = np.where(np.isnan(p1), p1, np.where(pulled == stretch, slope, 0.0))
        return force, slope

    def taut(self, stretch: Array) -> tuple[Array, Array, Array]:
        """(l, l2, dl2/dl) of the taut state at stretches (B, N): l is larger than the stretch where nothing is carried.

        A film held across is slack below l = max(l2, 1)^(-1/2), and where l2 is below l^(-1/2) it wrinkles across: it
        carries along what a strip with free sides does.
        """
        if self.across is None or self.pushes:
            pulled = np.maximum(stretch, 1e-3 if self.pushes else 1.0)
            return pulled, *self.rig.lateral(pulled, self.across)
        pulled = np.maximum(stretch, np.maximum(self.across, 1.0) ** -0.5)
        free = pulled**-0.5
        wrinkles = self.across < free
        return pulled, np.where(wrinkles, free, self.across), np.where(wrinkles, -0.5 * pulled**-1.5, 0.0)

    def note(self, stretch: Array) -> NDArray[np.int8]:
        """`Note` of states (B, N) whose stretch across was measured: slack, or wrinkled one way or the other."""
        if self.across is None or self.pushes:
            return np.zeros(stretch.shape, np.int8)
        pulled, l2, _ = self.taut(stretch)
        slack = (stretch <= 1.0) & (self.across <= 1.0) & (pulled > stretch)
        wrinkled = ~slack & ((pulled > stretch) | (l2 > self.across))
        return (Note.SLACK * slack + Note.WRINKLED * wrinkled).astype(np.int8)

    def varied(self, change: Array) -> StripLaw:
        """The law of films whose parameters differ by ``change`` (B, n)."""
        return replace(self, parameters=self.parameters + change)

    def of(self, rows: NDArray[np.intp] | slice) -> StripLaw:
        """The law of some of the films."""
        return replace(self, parameters=self.parameters[rows])

    @staticmethod
    def stack(laws: Sequence[StripLaw]) -> StripLaw:
        """The films of all laws, one after the other."""
        return replace(laws[0], parameters=np.concatenate([law.parameters for law in laws]))


def strip_curves(law: StripLaw, deflection: Array, sensitivities: bool = False) -> Curves:
    """Curves of the films of ``law`` at ``deflection`` (N,) m, which all are where ``across`` is, if that is given."""
    d = np.broadcast_to(deflection, (len(law.parameters), deflection.size))
    force, slope = law(d)
    stretch = np.maximum(1.0 + deflection[None, :] / law.rig.length, 1e-3)
    state, l2 = _states(law, stretch)
    p = law.parameters.T[:, :, None]
    rates = None
    with np.errstate(all="ignore"):
        w, _, _, a, b, c = law.material.derivatives(p, state, l2)
        if sensitivities:
            each = [s[1] + np.zeros(d.shape) for s in law.material.sensitivities(p, state, l2)]
            rates = np.where((force == 0)[:, :, None], 0.0, law.rig.width * np.stack(each, axis=2))
        convexity, ellipticity = _margins(law, a, b, c)
    return Curves(
        deflection=d,
        force=force,
        status=np.where(np.isfinite(force), Status.OK, Status.LOCKED).astype(np.int8),
        note=np.broadcast_to(law.note(stretch), d.shape),
        slope=slope,
        sensitivity=rates,
        variation=np.zeros(d.shape),
        max_stretch=np.broadcast_to(np.maximum(state, l2), d.shape),
        ellipticity=ellipticity,
        convexity=convexity,
        energy=w * law.rig.width * law.rig.length + np.zeros(d.shape),
    )


def strip_margins(law: StripLaw, deflection: Array) -> tuple[Array, Array]:
    """((B, N), (B, N)): convexity and ellipticity of `strip_curves`, without what else it tells."""
    state, l2 = _states(law, np.maximum(1.0 + deflection[None, :] / law.rig.length, 1e-3))
    with np.errstate(all="ignore"):
        _, _, _, a, b, c = law.material.derivatives(law.parameters.T[:, :, None], state, l2)
        return _margins(law, a, b, c)


def _states(law: StripLaw, stretch: Array) -> tuple[Array, Array]:
    """Both stretches (1, N) of all films, whose test has the stretches ``stretch`` (1, N)."""
    if law.across is None:
        return stretch, law.rig.lateral(stretch)[0]
    return law.taut(stretch)[:2]


def _margins(law: StripLaw, a: Array, b: Array, c: Array) -> tuple[Array, Array]:
    """Of Hessians [[a, b], [b, c]] (B, N), relative to G d (B,)."""
    gd = np.abs(np.asarray(law.material.shear_modulus(law.parameters.T)))[:, None]
    return np.asarray(least_eigenvalue(a, b, c) / gd), np.asarray(np.minimum(a, c) / gd)


def once(rows: Array) -> Array:
    """(1, N) of ``rows`` (B, N) that are one row seen B times; else as they are."""
    return rows[:1] if rows.strides[0] == 0 else rows
