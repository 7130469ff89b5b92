"""Films that need no solution: what they pass at their edges rules them out already."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.mechanics.request import Request, Spared
from bayesmembrane.physics.mechanics.solution import Curves, Note, Status

STATES = 24
"""At which an edge is looked at, between the flat film and the largest deflection."""
RULED_OUT = 1e-2
"""A margin of convexity or ellipticity below minus this rules a film out: points between the edges see it, too."""


@dataclass(frozen=True)
class Edges:
    """Films that are ruled out, and by what.

    films : (K,) which of those that were asked for
    ellipticity, convexity : (K,) least margins at the edges
    status : (K, N) `Status` of what was asked for: not elliptic from where P11 < 0 is passed, else unresolved
    """

    films: NDArray[np.intp]
    ellipticity: Array
    convexity: Array
    status: NDArray[np.int8]

    def curves(self, request: Request) -> Curves:
        """What is known of these films: at every deflection the least margins, and no force."""
        nowhere = np.full(self.status.shape, np.nan)
        return Curves(
            deflection=request.deflection[self.films],
            force=nowhere,
            status=self.status,
            note=np.full(self.status.shape, Note.NONE, np.int8),
            slope=nowhere,
            sensitivity=np.repeat(nowhere[..., None], request.parameters.shape[1], axis=2)
            if request.sensitivities
            else None,
            variation=nowhere,
            max_stretch=nowhere,
            ellipticity=np.repeat(self.ellipticity[:, None], self.status.shape[1], axis=1),
            convexity=np.repeat(self.convexity[:, None], self.status.shape[1], axis=1),
            energy=nowhere,
        )


def ruled_out_at_the_edges(request: Request) -> Edges:
    """Films of the kind that ``request`` spares by

        min over 1 < m < mean of M(l1 = l0 m, l2 = l0) < -0.01 G d,  mean = sqrt(1 + (delta / (R2 - R1))^2),

    with M = min(P11, P22) or the least eigenvalue of the Hessian of W; none if nothing is spared.

    At the clamp and at the disc the hoop stretch stays l0, and where tensions pull and P1 >= P2, R P1 grows outwards
    more slowly than R: P1 is largest at the disc, and with it l1, which is no less there than in the mean over the
    film. Loaded from the flat film it passes all that lies before. A film that was clamped slack is none of these.
    """
    if request.spare is Spared.NONE or not len(request.parameters):
        return _none(request)
    l0, span = request.prestretch, request.outer_radius - request.inner_radius
    mean = np.sqrt(1.0 + (np.abs(request.deflection) / span) ** 2)
    m = 1.0 + (np.max(mean, axis=1) - 1.0) * np.arange(1, STATES + 1)[:, None] / STATES
    with np.errstate(all="ignore"):
        _, _, _, p11, p12, p22 = request.material.derivatives(
            request.parameters.T[:, None, :], l0 * m, np.broadcast_to(l0, m.shape)
        )
        gd = np.broadcast_to(request.material.shear_modulus(request.parameters.T), l0.shape)
        elliptic = np.minimum(p11, p22) / gd
        convex = (0.5 * (p11 + p22) - np.hypot(0.5 * (p11 - p22), p12)) / gd
        margin = convex if request.spare is Spared.NOT_CONVEX else elliptic
        out = np.flatnonzero((np.fmin.reduce(margin, axis=0) < -RULED_OUT) & (l0 >= 1))
        if not out.size:
            return _none(request)
        bent = p11[:, out] < -RULED_OUT * gd[out]
        first = np.where(np.any(bent, axis=0), m[np.argmax(bent, axis=0), out], np.inf)
        status = np.where(mean[out] >= first[:, None], Status.NOT_ELLIPTIC, Status.UNRESOLVED).astype(np.int8)
        return Edges(out, np.fmin.reduce(elliptic[:, out], axis=0), np.fmin.reduce(convex[:, out], axis=0), status)


def _none(request: Request) -> Edges:
    nothing = np.empty(0)
    return Edges(np.empty(0, np.intp), nothing, nothing, np.empty((0, request.deflection.shape[1]), np.int8))
