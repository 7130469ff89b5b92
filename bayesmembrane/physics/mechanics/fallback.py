"""Ritz first; what it cannot bring to 1e-6 is tried by shooting."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from bayesmembrane.physics.mechanics.problem import Problem
from bayesmembrane.physics.mechanics.ritz import solver as ritz
from bayesmembrane.physics.mechanics.shooting import solver as shooting
from bayesmembrane.physics.mechanics.solution import Curves, Status


def solve(problem: Problem, sensitivities: bool = False, only: str = "all", exact_up_to: float = np.inf) -> Curves:
    """Curves by the Ritz method; deflections left `UNRESOLVED` or at the `ITERATION_LIMIT` are shot.

    So are those of a film that was clamped slack: its flat state is not stable, and no path leads on from there.
    ``only`` "convex" or "elliptic" leaves films as they are of which a resolved state shows that they are not so, and
    forces beyond the deflection ``exact_up_to`` good to 1e-3.
    """
    curves = ritz.solve(problem, sensitivities, only, exact_up_to)
    failed = np.isin(curves.status, (Status.UNRESOLVED, Status.ITERATION_LIMIT))
    failed |= (problem.prestretch < 1)[:, None] & (curves.status == Status.INDEFINITE)
    if only != "all":
        margin = curves.convexity if only == "convex" else curves.ellipticity
        failed &= ~np.any(margin < -ritz.RULED_OUT, axis=1)[:, None]
    films = np.flatnonzero(np.any(failed, axis=1))
    if films.size == 0:
        return curves
    part = replace(
        problem,
        parameters=problem.parameters[films],
        deflection=problem.deflection[films],
        prestretch=problem.prestretch[films],
    )
    shot = shooting.solve(part, sensitivities)
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
