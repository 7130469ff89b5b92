"""Ritz first; what it cannot bring to 1e-6 is tried by shooting."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from bayesmembrane.physics.mechanics.request import Request, Spared
from bayesmembrane.physics.mechanics.ritz import solver as ritz
from bayesmembrane.physics.mechanics.solution import Curves, Status


def solve(request: Request) -> Curves:
    """Curves by the Ritz method; deflections left `UNRESOLVED` or at the `ITERATION_LIMIT` are shot.

    So are those of a film that was clamped slack: its flat state is not stable, and no path leads on from there.
    Films that are to be spared stay as they are.
    """
    curves = ritz.solve(request)
    failed = np.isin(curves.status, (Status.UNRESOLVED, Status.ITERATION_LIMIT))
    failed |= (request.prestretch < 1)[:, None] & (curves.status == Status.INDEFINITE)
    if request.spare is not Spared.NONE:
        margin = curves.convexity if request.spare is Spared.NOT_CONVEX else curves.ellipticity
        failed &= ~np.any(margin < -ritz.RULED_OUT, axis=1)[:, None]
    films = np.flatnonzero(np.any(failed, axis=1))
    if films.size == 0:
        return curves
    shot = shoot(request.of(films))
    use = failed[films] & np.isin(shot.status, (Status.OK, Status.NOT_ELLIPTIC))
    merged = {}
    for f in fields(Curves):
        values = getattr(curves, f.name)
        if f.name == "deflection" or values is None:
            continue
        values = values.copy()
        mask = use[..., None] if values.ndim == 3 else use
        values[films] = np.where(mask, getattr(shot, f.name), values[films])
        merged[f.name] = values
    return replace(curves, **merged)


def shoot(request: Request) -> Curves:
    """Curves by shooting, imported on demand: SciPy's integrators take longer to import than a film to be solved."""
    from bayesmembrane.physics.mechanics.shooting import solver as shooting

    return shooting.solve(request)
