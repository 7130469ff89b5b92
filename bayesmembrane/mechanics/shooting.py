"""Shooting solver: the method of the source paper, compiled; an independent check of the Ritz method."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.polynomial import legendre

from bayesmembrane.materials.base import Material
from bayesmembrane.mechanics import shooting_kernels as kernels
from bayesmembrane.mechanics.compiled import bind
from bayesmembrane.mechanics.problem import Problem, extensibility
from bayesmembrane.mechanics.locking import locking_deflection
from bayesmembrane.mechanics.solution import Curves, Note, Status
from bayesmembrane.parameters import Array

RTOL = 1e-8
START = 2.0
# What an `ok` force must hold: change of R P1 sin(theta) over the film, and the boundary values.
FLUX_LIMIT = 3e-7
RESIDUAL_LIMIT = 1e-6
# A film whose last state had less than this of P11 / (G d) was lost because ellipticity was about to be.
NEARLY_BENT = 0.1
POINTS = 16


@cache
def compiled(material: type[Material]) -> Any:
    """The kernels of one material."""
    k = kernels
    return bind((k.rates, k.integrate, k.solve_one, k.first_state, k.walk, k.shoot, k.survey), material)


def states(problem: Problem, film: int, targets: Array, rtol: float = RTOL) -> Array:
    """(M, 5) at ascending scaled deflections (M,) > 0: l1(R1), th(R1), their slopes in d, iterations; nan if lost."""
    out = np.empty((targets.size, 5))
    start = float(np.clip(START, targets[0], targets[-1]))
    compiled(problem.material).shoot(
        targets, start, problem.prestretch[film], np.log(problem.ratio), problem.parameters[film], rtol, out
    )
    return out


def solve(problem: Problem, sensitivities: bool = False, rtol: float = RTOL) -> Curves:
    """Force curves from the initial value problem at the disc,

        F = 2 pi R1 P1 sin(theta) at R = R1, with (l1, theta)(R1) such that l2 = l0 and h = delta at the ring.

    Sensitivities, if asked for, are central differences in each parameter.
    """
    locks = locking_deflection(extensibility(problem), problem.prestretch, problem.ratio)
    lines = np.stack([_film(problem, i, float(locks[i]), rtol) for i in range(problem.parameters.shape[0])])
    curves = _curves(problem, lines)
    return replace(curves, sensitivity=_differences(problem, rtol)) if sensitivities else curves


def _film(problem: Problem, film: int, lock: float, rtol: float) -> Array:
    """(N, 13) : the rows of ``kernels.survey`` and the status code, in the order of the deflections asked for."""
    k, d = compiled(problem.material), problem.scaled[film]
    # A film that is not deflected carries no lift, but has a stiffness: it is looked at a small way up.
    d = np.where(d == 0, 1e-4, d)
    targets, back = np.unique(d, return_inverse=True)
    out = np.full((targets.size, 13), np.nan)
    out[:, 12] = np.where(targets >= lock, Status.LOCKED, Status.ITERATION_LIMIT)
    free = targets < lock
    if np.any(free):
        nodes, weights = legendre.leggauss(POINTS)
        found = states(problem, film, targets[free], rtol)
        p, l0, span = problem.parameters[film], problem.prestretch[film], np.log(problem.ratio)
        for i in np.flatnonzero(np.isfinite(found[:, 0])):
            k.survey(found[i], targets[i], l0, span, p, rtol, (nodes + 1) / 2, weights / 2, out[i, :12])
            out[i, 12] = _verdict(out[i])
        gd = float(problem.material.shear_modulus(p))
        out[:, 7:10] /= gd
        known = np.flatnonzero(np.isfinite(out[:, 7]))
        if known.size and np.any(found[:, 4] == -1):
            bent = out[known[-1], 7] < NEARLY_BENT
            ended = np.flatnonzero(free)[found[:, 4] == -1]
            out[ended, 12] = Status.NOT_ELLIPTIC if bent else Status.INDEFINITE
    return out[back]


def _verdict(line: Array) -> Status:
    exact = line[2] < FLUX_LIMIT and line[3] < RESIDUAL_LIMIT and line[4] < RESIDUAL_LIMIT
    if line[7] <= 0:
        return Status.NOT_ELLIPTIC
    return Status.OK if exact else Status.UNRESOLVED


def _curves(problem: Problem, lines: Array) -> Curves:
    rho = problem.inner_radius / problem.prestretch[:, None]
    sign = np.sign(problem.deflection)
    status = lines[..., 12].astype(np.int8)
    ok = status == Status.OK
    note = np.where(lines[..., 10] < 0, Note.WRINKLED, 0) | np.where(lines[..., 11] <= 0, Note.SLACK, 0)

    def column(index: int, factor: Any = 1.0) -> Array:
        return np.where(ok, lines[..., index] * factor, np.nan)

    return Curves(
        deflection=problem.deflection,
        force=column(0, 2 * np.pi * rho * sign),
        status=status,
        note=np.where(ok, note, 0).astype(np.int8),
        slope=column(1, 2 * np.pi),
        sensitivity=None,
        variation=column(2),
        max_stretch=column(6),
        ellipticity=column(8),
        convexity=column(9),
        energy=column(5, 2 * np.pi * rho**2),
    )


def _differences(problem: Problem, rtol: float) -> Array:
    columns = []
    for i in range(problem.parameters.shape[1]):
        step = 1e-4 * np.maximum(np.abs(problem.parameters[:, i]), 1e-3)
        forces = []
        for side in (1, -1):
            p = problem.parameters.copy()
            p[:, i] += side * step
            forces.append(solve(replace(problem, parameters=p), rtol=rtol * 1e-2).force)
        columns.append((forces[0] - forces[1]) / (2 * step[:, None]))
    return np.stack(columns, axis=-1)

