"""How much of a signature a measurement can see: whitened by the true noise, freed of what the material absorbs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares

from tests.generator.distortions import DISTORTIONS, LIBRARY, USUAL, Active, Scale, response
from tests.generator.energies import Array
from tests.generator.film import Film, NoSolutionError, film
from tests.generator.protocols import Path

LEAST_VISIBLE = 0.02
"""A rival whose signature keeps less than this part of its whitened length leaves no trace of its own."""


class Projector:
    """Whitening by a covariance, then projection off the columns (N, k) of ``absorbing``."""

    def __init__(self, covariance: Array, absorbing: Array) -> None:
        self.lower = np.linalg.cholesky(covariance)
        columns = self.whiten(absorbing)
        u, s, _ = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), full_matrices=False)
        self.basis = u[:, s > 1e-9 * s[0]]

    def whiten(self, x: Array) -> Array:
        """(N,) or (N, k) in units of the noise, independent."""
        return np.asarray(solve_triangular(self.lower, x, lower=True))

    def __call__(self, x: Array) -> Array:
        """What is left of ``x`` (N,), whitened and projected; its length is the signal-to-noise ratio."""
        w = self.whiten(x)
        return w - self.basis @ (self.basis.T @ w)


def sized(
    snr: Callable[[float], float],
    target: float,
    start: float,
    largest: float,
    tolerance: float = 0.005,
    most: int = 25,
) -> float:
    """The size whose ratio is ``target`` within ``tolerance``; if that is too weak, ``largest`` or where solutions end.

    The ratio grows about as a power of the size; the power is learnt from the last two sizes. The nearest of ``most``
    trials is returned, so the caller checks the ratio.
    """
    if target <= 0:
        return 0.0

    def level(size: float) -> float:
        try:
            return float(np.log(max(snr(size), 1e-12) / target))
        except NoSolutionError:
            return np.inf

    size, power = min(start, largest), 1.0
    low, high, before = 0.0, largest, None
    best = (np.inf, size)
    for _ in range(most):
        here = level(size)
        if np.isfinite(here) and abs(here) < best[0]:
            best = (abs(here), size)
        if abs(here) < tolerance or (here < 0 and size >= largest) or high - low < 1e-4 * high:
            break
        low, high = (max(low, size), high) if here < 0 else (low, min(high, size))
        if before is not None and np.isfinite(here) and np.isfinite(before[1]) and size != before[0]:
            power = float(np.clip((here - before[1]) / np.log(size / before[0]), 0.3, 4.0))
        before = (size, here)
        new = size * float(np.exp(np.clip(-here / power, -4.0, 4.0))) if np.isfinite(here) else 0.5 * (low + size)
        size = new if low < new < high else (largest if new >= largest == high else 0.5 * (low + high))
    return best[1]


def signature(film_: Film, path: Path, kind: str, form: str, scale: Scale = USUAL) -> Array:
    """(N,) N that a distortion of ``kind``, alone, in ``form`` with middling details and of a small size, adds."""
    d = DISTORTIONS[kind]
    active = Active(d.probe * scale.of(d.unit), form, d.middle(form))
    return response(film_, path, {kind: active}) - response(film_, path, {})


def rivals(film_: Film, path: Path, projector: Projector, scale: Scale = USUAL) -> dict[str, list[Array]]:
    """Unit projected signatures of every effect of the library, one per form; none of those that leave no trace."""
    out: dict[str, list[Array]] = {}
    for kind in LIBRARY:
        for form in DISTORTIONS[kind].forms:
            raw = signature(film_, path, kind, form, scale)
            left = projector(raw)
            whole = float(np.linalg.norm(projector.whiten(raw)))
            if whole > 0 and np.linalg.norm(left) > LEAST_VISIBLE * whole:
                out.setdefault(kind, []).append(left / np.linalg.norm(left))
    return out


def angle(direction: Array, others: list[Array], two_sided: bool) -> float:
    """Smallest angle in degrees of ``direction`` (N,) to one of ``others``; either sign of it if ``two_sided``."""
    cosines = np.array([direction @ o for o in others]) / np.linalg.norm(direction)
    cosine = float(np.max(np.abs(cosines) if two_sided else cosines))
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def best_fit(
    family: str, start: Array, rig: tuple[float, float, float], deflection: Array, force: Array, covariance: Array
) -> tuple[Array, Array]:
    """Parameters of a declarable ``family`` closest to ``force`` (N,), and the whitened residual.

    Signs of the start are kept where the family needs them; Gent's limit moves as its reciprocal, which may vanish.
    Within 25 steps, which the six parameters of an Ogden film may outlast: its residual is a bound from above.
    """
    lower = np.linalg.cholesky(covariance)
    logs = {"ogden": np.ones(6, bool), "gent": np.array([True, False])}.get(family, np.zeros(start.size, bool))
    scale = np.where(logs, 1.0, np.abs(start[0]))
    gent = family == "gent"

    def parameters(z: Array) -> Array:
        p = np.where(logs, start * np.exp(np.clip(z, -20, 20) * logs), start + z * scale)
        if gent:
            p[1] = 1 / z[1]
        return p

    def slopes(z: Array) -> Array:
        p = parameters(z)
        by = np.where(logs, p, scale)
        if gent:
            by[1] = -(p[1] ** 2)
        return by

    def law(z: Array) -> Film:
        return film(family, tuple(float(v) for v in parameters(z)), *rig, True)

    def residual(z: Array) -> Array:
        try:
            return np.asarray(solve_triangular(lower, law(z).force(deflection) - force, lower=True))
        except NoSolutionError:
            return np.full(force.size, np.inf)

    def jacobian(z: Array) -> Array:
        return np.asarray(solve_triangular(lower, law(z).sensitivities(deflection) * slopes(z), lower=True))

    first, low, high = np.zeros(start.size), np.full(start.size, -np.inf), np.full(start.size, np.inf)
    if gent:
        first[1], low[1], high[1] = 1 / start[1], 1e-6, 1.0
    if family == "ogden":
        low[3:], high[3:] = np.log(0.4), np.log(2.5)
    fit = least_squares(
        residual, first, jacobian, (low, high), x_scale="jac", ftol=1e-4, xtol=1e-6, gtol=1e-6, max_nfev=25
    )
    return parameters(fit.x), fit.fun
