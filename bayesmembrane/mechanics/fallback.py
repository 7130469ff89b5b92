"""Ritz first; what it cannot bring to 1e-6 is tried by shooting."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from bayesmembrane.mechanics import ritz, shooting
from bayesmembrane.mechanics.problem import Problem
from bayesmembrane.mechanics.solution import Curves, Status


def solve(problem: Problem, sensitivities: bool = False) -> Curves:
    """Curves by the Ritz method; deflections left `UNRESOLVED`, `INDEFINITE` or at the `ITERATION_LIMIT` are shot."""
    curves = ritz.solve(problem, sensitivities)
    failed = np.isin(curves.status, (Status.UNRESOLVED, Status.ITERATION_LIMIT))
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
