"""Shooting solver: the method of the source paper, compiled; an independent check of the Ritz method."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from bayesmembrane.ground.compiling import for_kernel
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics.compiled import bind
from bayesmembrane.physics.mechanics.locking import locking_deflection
from bayesmembrane.physics.mechanics.request import Request, extensibility
from bayesmembrane.physics.mechanics.shooting import kernels
from bayesmembrane.physics.mechanics.solution import Curves, Note, Status

RTOL = 1e-8
START = 2.0
# What an `ok` force must hold: change of R P1 sin(theta) over the film, and the boundary values.
FLUX_LIMIT = 3e-7
RESIDUAL_LIMIT = 1e-6
# A path whose last state has less than this of P11 / (G d) ends because ellipticity is about to be lost.
NEARLY_BENT = 0.1
SMALLEST = 1e-4


@cache
def compiled(material: type[Material]) -> Any:
    """The kernels of one material."""
    return bind(kernels.KERNELS, material)


def solve(request: Request, rtol: float = RTOL) -> Curves:
    """Force curves from the initial value request at the disc,

        F = 2 pi R1 P1 sin(theta) at R = R1, with (l1, theta)(R1) such that l2 = l0 and h = delta at the ring.

    Sensitivities, if asked for, are differences in each parameter, where there is a force: central, or one-sided next
    to a film that is lost. No film is spared.
    """
    locks = locking_deflection(extensibility(request), request.prestretch, request.ratio)
    lines = np.stack([_film(request, i, float(locks[i]), rtol) for i in range(request.parameters.shape[0])])
    curves = _curves(request, lines)
    return replace(curves, sensitivity=_where_ok(request, curves, rtol)) if request.sensitivities else curves


def _film(request: Request, film: int, lock: float, rtol: float) -> Array:
    """(N, SEEN + 1) : the rows of ``kernels.survey`` and the status code, in the order of the deflections asked for."""
    k = kernels
    # A film that is not deflected carries no lift, but has a stiffness: it is looked at a small way up.
    targets, back = np.unique(np.maximum(request.scaled[film], SMALLEST), return_inverse=True)
    out = np.full((targets.size, k.SEEN + 1), np.nan)
    free = targets < lock
    out[:, k.SEEN] = np.where(free, Status.ITERATION_LIMIT, Status.LOCKED)
    if np.any(free):
        p, count = for_kernel(request.parameters[film]), int(np.sum(free))
        lines, found = np.empty((count + 1, k.SEEN)), np.empty((count, 3))
        start = float(np.clip(START, targets[0], targets[count - 1]))
        compiled(request.material).shoot(
            targets[free], start, request.prestretch[film], np.log(request.ratio), p, rtol, found, lines
        )
        lines[:, k.LEAST_P11 : k.LEAST_P2] /= float(request.material.shear_modulus(p))
        out[:count, : k.SEEN] = lines[:-1]
        out[:count, k.SEEN] = _verdict(lines[:-1], lines[-1])
    return out[back]


def _verdict(lines: Array, end: Array) -> Array:
    """`Status` codes (M,) of what was seen (M, SEEN) along a path, and at its end (SEEN,) if it has one."""
    k = kernels
    exact = (lines[:, k.VARIATION] < FLUX_LIMIT) & (lines[:, [k.MISS_1, k.MISS_2]] < RESIDUAL_LIMIT).all(axis=1)
    status = np.where(exact, Status.OK, Status.UNRESOLVED)
    status[lines[:, k.LEAST_P11] <= 0] = Status.NOT_ELLIPTIC
    lost = np.isnan(lines[:, k.FORCE])
    status[lost] = Status.ITERATION_LIMIT
    if np.isfinite(end[k.LEAST_P11]) and lost[-1]:
        beyond = np.logical_and.accumulate(lost[::-1])[::-1]
        status[beyond] = Status.NOT_ELLIPTIC if end[k.LEAST_P11] < NEARLY_BENT else Status.INDEFINITE
    return np.asarray(status, dtype=float)


def _curves(request: Request, lines: Array) -> Curves:
    """Undo the scaling."""
    k = kernels
    status = lines[..., k.SEEN].astype(np.int8)
    ok, sign = status == Status.OK, np.sign(request.deflection)
    length = request.inner_radius / request.prestretch[:, None]
    note = np.where(lines[..., k.LEAST_P2] < 0, Note.WRINKLED, 0) | np.where(lines[..., k.SLACK] <= 0, Note.SLACK, 0)

    def column(index: int, factor: Any = 1.0) -> Array:
        return np.where(ok, lines[..., index] * factor, np.nan)

    return Curves(
        deflection=request.deflection,
        force=column(k.FORCE, 2 * np.pi * length * sign),
        status=status,
        note=np.where(ok, note, 0).astype(np.int8),
        slope=column(k.SLOPE, 2 * np.pi),
        sensitivity=None,
        variation=column(k.VARIATION),
        max_stretch=column(k.STRETCH),
        ellipticity=column(k.ELLIPTIC),
        convexity=column(k.CONVEX),
        energy=column(k.STORED, 2 * np.pi * length**2),
    )


def _where_ok(request: Request, curves: Curves, rtol: float) -> Array:
    """dF/dp (B, N, n) where the forces are, else nan: what cannot be solved costs most, and would for every step."""
    out = np.full((*curves.force.shape, request.parameters.shape[1]), np.nan)
    films = np.flatnonzero(np.any(curves.ok, axis=1))
    if films.size:
        some, ok = request.of(films), curves.ok[films]
        first = np.take_along_axis(some.deflection, np.argmax(ok, axis=1)[:, None], axis=1)
        there = _differences(replace(some, deflection=np.where(ok, some.deflection, first)), rtol)
        out[films] = np.where(ok[:, :, None], there, np.nan)
    return out


def _differences(request: Request, rtol: float) -> Array:
    """dF/dp (B, N, n): central, or to the side that has a force where the other film is no longer stable."""
    tight, plain = rtol * 1e-2, replace(request, sensitivities=False)

    def force(parameters: Array) -> Array:
        return solve(replace(plain, parameters=parameters), rtol=tight).force

    middle = None
    columns = []
    for i in range(request.parameters.shape[1]):
        step = 1e-4 * np.maximum(np.abs(request.parameters[:, i]), 1e-3)
        forces = []
        for side in (1, -1):
            p = request.parameters.copy()
            p[:, i] += side * step
            forces.append(force(p))
        column = (forces[0] - forces[1]) / (2 * step[:, None])
        if np.any(np.isfinite(forces[0]) != np.isfinite(forces[1])):
            middle = force(request.parameters) if middle is None else middle
            for side, there in zip((1, -1), forces, strict=True):
                column = np.where(np.isnan(column), side * (there - middle) / step[:, None], column)
        columns.append(column)
    return np.stack(columns, axis=-1)
