"""What a solver returns: forces with a status each, never a silent nan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from enum import IntEnum, IntFlag

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array


class Status(IntEnum):
    """Why a force is there, or is not. Every force but an `OK` one is nan."""

    OK = 0
    LOCKED = 1
    NOT_ELLIPTIC = 2
    INDEFINITE = 3
    UNRESOLVED = 4
    ITERATION_LIMIT = 5

    @property
    def label(self) -> str:
        """The word in tables and JSON answers."""
        return self.name.lower().replace("_", " ")

    @property
    def sentence(self) -> str:
        """Cause and remedy, for people."""
        return _SENTENCES[self]

    @property
    def physical(self) -> bool:
        """True where the model itself has no stable state there, False where the numbers failed."""
        return self in (Status.LOCKED, Status.NOT_ELLIPTIC, Status.INDEFINITE)


_SENTENCES = {
    Status.OK: "ok",
    Status.LOCKED: "locked: the deflection is beyond the one at which the chains are fully stretched; lower it or "
    "raise the limit",
    Status.NOT_ELLIPTIC: "not elliptic: the meridional stiffness P11 falls to zero on the way there, so the film has "
    "no stable smooth state; these parameters do not describe a film at this deflection",
    Status.INDEFINITE: "indefinite: the equilibrium found is not a minimum of the energy, or the path turns back "
    "before, so the film would leave it; these parameters do not describe a film at this deflection",
    Status.UNRESOLVED: "unresolved: finer polynomials would still release energy after every refinement, so the force "
    "is not exact to 1e-6",
    Status.ITERATION_LIMIT: "iteration limit: no solver converged; try fewer and smaller steps, or report these "
    "parameters",
}


class Note(IntFlag):
    """What an `OK` solution passes through."""

    NONE = 0
    SLACK = 1
    """P1 <= 0 and P2 <= 0 somewhere: that part carries nothing."""
    WRINKLED = 2
    """P1 > 0 > P2 somewhere: the hoop direction is compressed, and a real film wrinkles."""


@dataclass(frozen=True)
class Curves:
    """Force-deflection curves of B films at N deflections each (SI units throughout).

    Attributes
    ----------
    deflection : (B, N) m
    force : (B, N) N, positive for a lifted disc; nan where ``status`` is not `Status.OK`
    status : (B, N) `Status` codes
    note : (B, N) `Note` flags
    slope : (B, N) dF/d(deflection), N/m
    sensitivity : (B, N, n) dF/d(parameter i), or None if not asked for
    variation : (B, N) rms variation of R P1 sin(theta) over the film relative to its mean; 0 for an exact solution
    max_stretch : (B, N) largest principal stretch in the film
    ellipticity : (B, N) least of P11 and P22 over the film, relative to G d; > 0 is `elliptic`
    convexity : (B, N) least eigenvalue of the Hessian of W over the states reached, relative to G d; >= 0 is convex
    energy : (B, N) stored energy, J
    """

    deflection: Array
    force: Array
    status: NDArray[np.int8]
    note: NDArray[np.int8]
    slope: Array
    sensitivity: Array | None
    variation: Array
    max_stretch: Array
    ellipticity: Array
    convexity: Array
    energy: Array

    @property
    def ok(self) -> NDArray[np.bool_]:
        """(B, N) True where the force can be used."""
        return np.asarray(self.status == Status.OK)

    def of(self, films: NDArray[np.intp]) -> Curves:
        """Those of some films, in their order."""
        every = {f.name: getattr(self, f.name) for f in fields(self)}
        return replace(self, **{name: v[films] for name, v in every.items() if v is not None})

    def tally(self) -> dict[str, int]:
        """How many forces carry each status, by label; statuses that do not occur are left out."""
        codes, counts = np.unique(self.status, return_counts=True)
        return {Status(int(c)).label: int(k) for c, k in zip(codes, counts, strict=True)}


def joined(parts: Sequence[Curves]) -> Curves:
    """The films of all parts, in order; those of each at as many deflections."""
    every = {f.name: [getattr(part, f.name) for part in parts] for f in fields(Curves)}
    return replace(parts[0], **{name: np.concatenate(v) for name, v in every.items() if v[0] is not None})


@dataclass(frozen=True)
class Profile:
    """The deformed film at one deflection, from the inner edge to the outer one.

    Attributes
    ----------
    radius, f, height : (M,) m: clamped radius R, deformed radius f, and height h above the ring
    l1, l2 : (M,) meridional and hoop stretch
    angle : (M,) slope angle theta, rad: from the horizontal, positive where the film rises towards the disc
    tension_1, tension_2 : (M,) nominal tensions P1, P2, N/m
    force, energy : N and J
    status : `Status`
    """

    radius: Array
    f: Array
    height: Array
    l1: Array
    l2: Array
    angle: Array
    tension_1: Array
    tension_2: Array
    force: float
    energy: float
    status: Status
