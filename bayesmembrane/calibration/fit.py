"""Least squares: the global optimum of a hypothesis on a measurement, without and with the convexity prior's bound."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayesmembrane.calibration.constrained import constrained_optimum
from bayesmembrane.calibration.descent import Patience, descend
from bayesmembrane.calibration.objective import Objective, separated
from bayesmembrane.calibration.posterior import enough_points
from bayesmembrane.data.fixture import Fixture
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.thinning import shortened
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.showable import Showable
from bayesmembrane.physics.convexity import FREE, REACHED, RESTRICTING
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
from bayesmembrane.physics.mechanics import api

STARTED, POLISHED = 12, 2
FEWEST, SLOPES = 4, 200  # starts: a step from one costs as many slopes as there are coordinates, of all so many at most
APART, DISTINCT = 1.5, 0.3  # least distance of starts, and of what they lead to, in prior standard deviations
HOPEFUL = 10.0  # a start that misses the data by this many times the best one's |r| is not followed
FEW, ROUGH = 50, 1e-4  # evaluations and tolerance of a first search
NEAR = 1e-3  # of the width of the bounds: an estimate this close is at the bound
FLAT = 1e-4  # a loss that rises by less than this part on the way to the bound has no minimum before it
TO_BOUND, FEWEST_TO_BOUND = 40, 8  # iterations towards a bound
MOST_SLOPES = 20_000  # on the way to all lower, or upper, bounds together
MANY = 5000  # readings with which valleys are looked for: hundreds of films at once are kept in memory
LOWER = 1e-9  # a simpler energy's optimum is taken where it leads lower by more than this part: less is round-off


@dataclass(frozen=True)
class FittedParameter:
    """A fitted parameter; ``sd`` is None where the data set no scale (at a bound, or no degree of freedom left)."""

    value: float
    sd: float | None
    unit: str


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Showable):
    """The optimum of one loss.

    Attributes
    ----------
    hypothesis : what was fitted; its noise model plays no part
    loss : "euclidean" (|F - y|_2, the loss of the source paper) or "weighted" (by the measurement's own noise)
    coordinates : (k,) coordinates that shape the curve, at the optimum
    covariance : (k, k) of the coordinates, from the Jacobian and the residual variance; nan at a bound
    parameters : natural parameters by full name
    deflection, force : (N,) m and N, of the fitted curve
    loss_N, rmse_N, max_N : |F - y|_2, its root mean square, and the largest |F - y|, N
    objective : what was minimised: `loss_N`, or the root of the weighted sum of squares
    margins : by how much each convexity mode is met; below 0 it is not
    at_bound : coordinates without an optimum inside their bounds: the loss falls, or is flat, up to the bound
    status : "converged", or why the search ended, or in a sentence why there is no fit: then all numbers are nan
    constrained : the optimum among films that meet the convexity prior; this one if it does; None without any
    rig, thickness, origin : what held the film, m, and where the points come from: as people see the curve
    """

    hypothesis: Hypothesis
    loss: str
    coordinates: Array
    covariance: Array
    parameters: dict[str, FittedParameter]
    deflection: Array
    force: Array
    loss_N: float  # noqa: N815 - the unit is part of the name that users read
    rmse_N: float  # noqa: N815
    max_N: float  # noqa: N815
    objective: float
    margins: dict[str, float]
    at_bound: tuple[str, ...]
    status: str
    constrained: Fit | None = field(default=None, repr=False)
    rig: Fixture | None = None
    thickness: float = math.nan
    origin: str = ""

    @property
    def convex(self) -> bool:
        """True if the hypothesis' convexity prior holds; if it asks for nothing, that of the states reached."""
        own = self.hypothesis.convexity
        mode = own if own.restricts else REACHED
        return bool(mode.holds(self.margins[mode.name]))

    @property
    def shear_modulus(self) -> float:
        """Pa, the initial one: G d over the thickness; nan where that is not known."""
        material = self.hypothesis.material
        fields = [self.parameters[f"{material.name}.{n}"].value for n in material.field_names()]
        return float(np.ravel(material.shear_modulus(np.array(fields)[:, None]))[0]) / self.thickness

    def summary(self) -> dict[str, Any]:
        """Plain values for the JSON answer of ``fit``; parameters under their short names."""
        material = f"{self.hypothesis.material.name}."
        short = {k.removeprefix(material): {"value": e.value, "sd": e.sd} for k, e in self.parameters.items()}
        answer: dict[str, Any] = {
            "material": self.hypothesis.material.name,
            "loss": self.loss,
            "parameters": short,
            "shear_modulus_Pa": self.shear_modulus if np.isfinite(self.thickness) else None,
            "rmse_N": self.rmse_N,
            "loss_N": self.loss_N,
            "max_N": self.max_N,
            "convex": self.convex,
            "margins": {k: v if np.isfinite(v) else None for k, v in self.margins.items()},
            "at_bound": list(self.at_bound),
            "status": self.status,
        }
        if self.constrained is not None and self.constrained is not self:
            answer["constrained"] = self.constrained.summary()
        return answer


def fit(
    measurement: Measurement,
    hypothesis: Hypothesis,
    *,
    loss: str = "euclidean",
    seed: int = 0,
    starts: Iterable[ArrayLike] = (),
    solve: Solve = api.solve,
) -> Fit:
    """The global minimum of |F(x) - y|_2, or of |L^-1 (F(x) - y)|_2 with the measurement's noise L L^T ("weighted").

    Draws from the prior, and from a wider one, are brought to their best modulus, which is linear; from the best ones
    that lie apart, and from ``starts`` (membrane parameters (n,), for example published ones), a trust-region method
    descends with exact derivatives, at first a little and then from the best ones to the end. So does one from the
    optimum of the neo-Hookean film, with the same effects, where the energy contains it (`Material.neo_hookean`): no
    fit is worse than that of the energy inside. Bounds are those of the coordinates, not the prior, which plays no
    part but for the convexity constraint. Ogden films are sought among those with c_i a_i > 0 only, which its
    coordinates cover.

    Of more than `MANY` readings the valleys are looked for with that many of them (`data.thinning.shortened`), and the
    optimum is then that of all; the one under the convexity prior is that of the part, with the loss of all.

    Standard errors are s^2 (J^T J)^-1 with s^2 = |r|^2 / (N - k): the misfit counts as noise. A frame that a blank run
    shows is held as that has it, and its error is in the others.

    Raises `SettingsError` for fewer points than parameters, a loss that is unknown or lacks a noise, and a material
    whose films cannot reach the data.
    """
    claim = hypothesis.with_frame(measurement)
    found = _fitted(measurement, claim.held, loss, seed, [np.asarray(s, dtype=float) for s in starts], solve)
    return found if claim.held == claim else _released(found, claim, measurement, solve)


def _fitted(
    measurement: Measurement, hypothesis: Hypothesis, loss: str, seed: int, films: list[Array], solve: Solve
) -> Fit:
    """`fit` of a hypothesis all of whose coordinates are in question; ``films`` to start from, too."""
    enough_points(hypothesis, measurement, priors=False)
    few = shortened(measurement, MANY)
    objective = Objective(hypothesis, few, loss, solve)
    pool, contained, (x, status) = _searched(objective, seed, films)
    search = objective
    if few is not measurement:
        objective = Objective(hypothesis, measurement, loss, solve)
        x, _, status = objective.polish(x)
    free = _result(objective, x, status)
    if not hypothesis.convexity.restricts or free.convex or not np.isfinite(free.objective):
        return replace(free, constrained=free)
    y = constrained_optimum(search, pool, free.coordinates, contained)
    held = None if y is None else _result(objective, y, "converged")
    if held is not None and held.objective < free.objective:
        # The constraint led to a better valley: it is open without the constraint too.
        x, lower, status = objective.polish(held.coordinates)
        free = _result(objective, x, status) if lower < held.objective else held
        held = free if free.convex else held
    return replace(free, constrained=held)


def _released(found: Fit, claim: Hypothesis, measurement: Measurement, solve: Solve) -> Fit:
    """The same with what is known of the rig among the coordinates: at its value, and its error in all of them.

    The covariance is s^2 (J^T J + s^2 P)^-1, with 1 / sd^2 of what is known on the diagonal of P.
    """
    objective = Objective(claim, measurement, found.loss, solve)
    known = np.array([p.name in claim.known_coordinates for p in objective.parameters])
    values, sds = np.array([p.prior.mean_sd for p in objective.parameters]).T
    x = np.where(known, values, 0.0)
    x[~known] = found.coordinates
    bound = np.isin([p.name for p in objective.parameters], found.at_bound)
    covariance = np.full((x.size, x.size), np.nan)
    if math.isfinite(found.objective):
        r, jacobian = objective(x)
        dof = max(len(r) - int(np.count_nonzero(~known & ~bound)), 1)
        rows = np.diag(float(np.linalg.norm(r)) / math.sqrt(dof) / sds)[known]
        covariance = _covariance(np.append(r, np.zeros(len(rows))), np.vstack([jacobian, rows]), bound)
    inner = found.constrained
    return replace(
        found,
        hypothesis=claim,
        coordinates=x,
        covariance=covariance,
        parameters=_fitted_parameters(objective, x, covariance),
        constrained=None if inner is None else _released(inner, claim, measurement, solve),
    )


def _searched(objective: Objective, seed: int, published: list[Array]) -> tuple[Array, list[Array], tuple[Array, str]]:
    """Starts (M, k), the optima of simpler energies, and the optimum (x, status) without the convexity prior."""
    pool, size = objective.pool(np.random.default_rng(seed))
    contained = _contained(objective, seed)
    return pool, contained, _best_of_starts(objective, pool[size < HOPEFUL * size[0]], published, contained)


def _contained(objective: Objective, seed: int) -> list[Array]:
    """What the optimum of the neo-Hookean film with the same effects is in coordinates (k,) of this hypothesis."""
    h = objective.hypothesis
    if h.material is NeoHookean or h.material.neo_hookean(1.0) is None:
        return []
    simple = replace(h, material=NeoHookean, convexity=FREE)
    search = Objective(simple, objective.measurement, objective.loss, objective.forward.solve)
    _, _, (x, _) = _searched(search, seed, [])
    material = h.material.neo_hookean(float(np.exp(x[0])))
    return [] if material is None else [np.concatenate([material, x[1:]])]


def _best_of_starts(
    objective: Objective, pool: Array, published: list[Array], contained: list[Array]
) -> tuple[Array, str]:
    """The best of all polished starts, (x, status)."""
    h = objective.hypothesis
    starts = separated(pool, objective.spread * APART, int(np.clip(SLOPES // h.curve_size, FEWEST, STARTED)))
    for films in published:
        start = h.material.to_coordinates(h.material.from_vector(films).vector)
        if np.all(np.isfinite(start)):
            starts.append(np.concatenate([start, starts[0][h.material_size :]]))
    first = sorted((objective.polish(s, FEW, ROUGH) for s in starts if np.all(np.isfinite(objective(s)[0]))), key=_size)
    best = separated(np.array([x for x, size, _ in first if np.isfinite(size)]), objective.spread * DISTINCT, POLISHED)
    found = min((objective.polish(b) for b in best), key=_size, default=(pool[0], np.inf, ""))
    for x in contained:
        # At a bound a search keeps off it, and may end higher than it was told to start.
        there = x, float(np.linalg.norm(objective(x)[0])), "converged"
        for other in (objective.polish(x), there):
            found = other if other[1] < found[1] * (1 - LOWER) else found
    return found[0], found[2]


def _size(found: tuple[Array, float, str]) -> float:
    return found[1]


# ---- what is said of it ----------------------------------------------------------------------------------------------


def _result(objective: Objective, x: Array, status: str) -> Fit:
    """Everything about the optimum x (k,); where it has no curve or no slopes, nan and the reason."""
    r, jacobian = objective(x)
    prediction = objective.forward(x)
    force = prediction.force[0]
    if not np.all(np.isfinite(force)):
        # What lies beyond the data is solved along with it, and may cost the film its path.
        force = objective.forward(x, reached=False).force[0]
    if not np.all(np.isfinite(force)) or not np.all(np.isfinite(r)):
        status, r, force = _no_fit(objective), np.full_like(r, np.nan), np.full_like(force, np.nan)
    misfit = force - objective.measurement.force
    there = bool(np.all(np.isfinite(r)))
    bound = _at_bound(objective, x, float(np.linalg.norm(r))) if there else np.zeros(x.size, bool)
    covariance = _covariance(r, jacobian, bound) if there else np.full((x.size, x.size), np.nan)
    return Fit(
        hypothesis=objective.hypothesis,
        loss=objective.loss,
        coordinates=x,
        covariance=covariance,
        parameters=_fitted_parameters(objective, x, covariance),
        deflection=objective.measurement.deflection,
        force=force,
        loss_N=float(np.linalg.norm(misfit)),
        rmse_N=float(np.sqrt(np.mean(misfit**2))),
        max_N=float(np.max(np.abs(misfit))),
        objective=float(np.linalg.norm(r)),
        margins={m.name: float(m.margin(prediction, objective.hypothesis.material)[0]) for m in RESTRICTING},
        at_bound=tuple(p.name for p, b in zip(objective.parameters, bound, strict=True) if b),
        status=status,
        rig=objective.measurement.rig,
        thickness=objective.measurement.specimen.thickness,
        origin=objective.measurement.provenance.origin,
    )


def _no_fit(objective: Objective) -> str:
    return (
        f"no fit: no {objective.hypothesis.label()} film was found that reaches "
        f"{1e3 * np.max(objective.measurement.deflection):g} mm with finite forces and slopes; "
        "use a shorter range or another material"
    )


def _at_bound(objective: Objective, x: Array, size: float) -> NDArray[np.bool_]:
    """(k,) True where the loss falls, or stays flat, up to a bound while the others follow."""
    near = np.minimum(x - objective.low, objective.high - x) < NEAR * (objective.high - objective.low)
    sd = np.sqrt(np.diag(_covariance(*objective(x), np.zeros(x.size, bool))))
    loose, bounds, enough = ~(sd < 0.5 * objective.spread), (objective.low, objective.high), size * (1 + FLAT)
    for bound in bounds:
        # How far below the loss falls does not matter, nor what is at the other bound then.
        if (open_ := np.flatnonzero(~near & loose)).size:
            held = np.arange(x.size) == open_[:, None]
            moved = np.where(held, bound, x)
            steps = int(np.clip(MOST_SLOPES // moved.size, FEWEST_TO_BOUND, TO_BOUND))
            _, reached = descend(objective.batch, moved, bounds, steps, held, Patience(enough=enough))
            near[open_] = reached < enough
    return np.asarray(near)


def _fitted_parameters(objective: Objective, x: Array, covariance: Array) -> dict[str, FittedParameter]:
    """Natural parameters, with errors by d natural / d x."""
    h, n = objective.hypothesis, objective.hypothesis.material_size
    values = h.films(x[None, :])[0]
    jacobian = objective.forward.jacobian(x[None, :])[0][:, :n]
    held = np.isnan(np.diag(covariance))
    inner = np.where(held[:n, None] | held[None, :n], 0.0, covariance[:n, :n])
    sd = np.sqrt(np.einsum("ij,jk,ik->i", jacobian, inner, jacobian))
    # A parameter that moves with a held coordinate has no error to speak of.
    sd[np.any((np.abs(jacobian) > 1e-9 * np.abs(values[:, None])) & held[:n], axis=1)] = np.nan
    every = np.concatenate([values, x[n:]]), np.concatenate([sd, np.sqrt(np.diag(covariance))[n:]])
    return {
        name: FittedParameter(float(value), float(s) if np.isfinite(s) else None, unit)
        for name, value, s, unit in zip(h.natural_names, *every, h.natural_units, strict=False)
    }


def _covariance(r: Array, jacobian: Array, held: NDArray[np.bool_]) -> Array:
    """s^2 (J^T J)^-1 (k, k) without the coordinates that are ``held``, which are nan; nan if N = k."""
    k = jacobian.shape[1]
    out = np.full((k, k), np.nan)
    free = np.flatnonzero(~held)
    dof = len(r) - free.size
    if free.size and dof > 0:
        _, s, vt = np.linalg.svd(jacobian[:, free], full_matrices=False)
        with np.errstate(divide="ignore", over="ignore"):
            # What the data do not see at all has an error beyond all bounds, and yet a number.
            root = vt.T / np.maximum(s, 1e-150 * max(1.0, float(np.linalg.norm(r))))
        out[np.ix_(free, free)] = root @ root.T * (r @ r) / dof
    return out
