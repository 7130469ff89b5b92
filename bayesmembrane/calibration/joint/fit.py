"""Least squares on several tests of one material at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.calibration.joint.claim import Joint
from bayesmembrane.calibration.joint.objective import JointObjective, with_fewer_readings
from bayesmembrane.calibration.posterior import enough_points
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.showable import Showable
from bayesmembrane.physics.convexity import REACHED, RESTRICTING
from bayesmembrane.physics.forward import Solve
from bayesmembrane.physics.mechanics import api

BEST = 2  # optima that are looked at with all readings
FLAT = 1e-3  # cosine between the residuals and a coordinate, below which a search has ended at a minimum
NEAR = 1e-6  # of the width of the bounds: an estimate this close is at the bound


@dataclass(frozen=True, eq=False)
class FittedPart:
    """One test at the joint optimum.

    label : which
    force : (N,) N, of the fitted curve
    rmse_N, max_N : root mean square and largest size of F - y, N
    noise_N : root mean square of the noise that it is weighed by, N
    stated : whether the measurement states that noise; else it is the root mean square residual itself
    reduced_chi2 : mean square residual in units of the stated noise; None without any
    parameters : membrane parameters of its film, and its own effects, by name
    """

    label: str
    force: Array
    rmse_N: float  # noqa: N815 - the unit is part of the name that users read
    max_N: float  # noqa: N815
    noise_N: float  # noqa: N815
    stated: bool
    reduced_chi2: float | None
    parameters: dict[str, float]


@dataclass(frozen=True, eq=False, repr=False)
class JointFit(Showable):
    """The joint optimum.

    Attributes
    ----------
    joint : what was fitted; noise models play no part
    coordinates : (K',) coordinates that shape the curves, at the optimum
    covariance : (K', K') of them, from the Jacobian and the residual variance; nan at a bound
    names, values, sds : natural parameters of the thinnest film, effects of the tests; nan where nothing sets a scale
    parts : the tests
    objective : root of the sum of squares in units of the noises
    status : "converged", or "evaluation limit" where the residual still has a slope
    margins : by how much each convexity mode is met in the test that meets it least
    at_bound : coordinates that stopped at a bound
    """

    joint: Joint
    coordinates: Array
    covariance: Array
    names: tuple[str, ...]
    values: Array
    sds: Array
    parts: tuple[FittedPart, ...]
    objective: float
    status: str
    margins: dict[str, float]
    at_bound: tuple[str, ...]

    @property
    def misfit(self) -> Array:
        """F - y of all tests, one after the other, N."""
        parts = zip(self.parts, self.joint.parts, strict=True)
        return np.concatenate([found.force - part.measurement.force for found, part in parts])

    @property
    def convex(self) -> bool:
        """True if the convexity prior holds in every test; if it asks for nothing, that of the states reached."""
        own = self.joint.convexity
        mode = own if own.restricts else REACHED
        return bool(mode.holds(self.margins[mode.name]))

    @property
    def parameters(self) -> dict[str, tuple[float, float | None]]:
        """(value, standard deviation) by short name: the material's without their component."""
        sds = [float(s) if np.isfinite(s) else None for s in self.sds]
        prefix = f"{self.joint.material.name}."
        return {n.removeprefix(prefix): (float(v), s) for n, v, s in zip(self.names, self.values, sds, strict=True)}

    def summary(self) -> dict[str, Any]:
        """Plain values of the JSON answer of ``fit`` on several measurements."""
        return {
            "material": self.joint.material.name,
            "parameters": {n: {"value": v, "sd": s} for n, (v, s) in self.parameters.items()},
            "thickness_um": 1e6 * self.joint.thickness,
            "objective": self.objective,
            "rmse_N": float(np.sqrt(np.mean(self.misfit**2))),
            "loss_N": float(np.linalg.norm(self.misfit)),
            "status": self.status,
            "convex": self.convex,
            "margins": {k: v if np.isfinite(v) else None for k, v in self.margins.items()},
            "at_bound": list(self.at_bound),
            "tests": {
                p.label: {
                    "rmse_N": p.rmse_N,
                    "max_N": p.max_N,
                    "noise_N": p.noise_N,
                    "noise_stated": p.stated,
                    "reduced_chi2": p.reduced_chi2,
                    "parameters": p.parameters,
                }
                for p in self.parts
            },
        }


def fit_jointly(joint: Joint, *, seed: int = 0, solve: Solve = api.solve) -> JointFit:
    """The minimum of sum_m |L_m^-1 (F_m(x) - y_m)|^2 with the noise L_m L_m^T that each test states.

    A test that states none is weighed by its own root mean square residual, which maximises its likelihood. Starts that
    are good for one test are looked at in all, and from the best of them, and from neo-Hookean films, all descend at
    once with exact derivatives; of very long tests with some of their readings first. Standard errors are
    s^2 (J^T J)^-1 with s^2 = |r|^2 / (N - K'). What a blank run shows of a frame is held.

    Raises `SettingsError` for a test of fewer points than parameters, and a material that does not reach all of them.
    """
    joint = joint.held
    for part in joint.parts:
        enough_points(part.hypothesis, part.measurement, priors=False)
    few = with_fewer_readings(joint)
    objective = JointObjective(few, solve)
    x, _, noises = objective.settled(objective.starts(np.random.default_rng(seed)))
    if few is not joint:
        objective = JointObjective(joint, solve)
        x, _, noises = objective.settled(x[:BEST])
    return _result(objective, x[0], noises)


def _result(objective: JointObjective, x: Array, noises: Array) -> JointFit:
    joint = objective.joint
    r, jacobian = (v[0] for v in objective.batch(x[None, :], noises))
    low, high = objective.bounds
    bound = np.minimum(x - low, high - x) < NEAR * (high - low)
    covariance = _covariance(r, jacobian, ~bound)
    whole = np.zeros(len(joint.parameters))
    whole[joint.curve] = x
    margins: dict[str, list[float]] = {m.name: [] for m in RESTRICTING}
    parts = []
    for i in range(len(joint.parts)):
        own = joint.of(i, whole)[None, :]
        prediction = objective.parts[i].forward(own)
        for mode in RESTRICTING:
            margins[mode.name].append(float(mode.margin(prediction, joint.material)[0]))
        parts.append(_part(objective, i, prediction.force[0], float(noises[i]), own))
    names, values, sds = _natural(objective, whole, covariance)
    return JointFit(
        joint=joint,
        coordinates=x,
        covariance=covariance,
        names=names,
        values=values,
        sds=sds,
        parts=tuple(parts),
        objective=float(np.linalg.norm(r)),
        status="converged" if _slope(r, jacobian[:, ~bound]) < FLAT else "evaluation limit",
        margins={name: min(found) for name, found in margins.items()},
        at_bound=tuple(joint.parameters[i].name for i, b in zip(joint.curve, bound, strict=True) if b),
    )


def _slope(r: Array, jacobian: Array) -> float:
    """Largest cosine between the residuals (N,) and what a coordinate changes of them (N, k); 0 at a minimum."""
    sizes = np.linalg.norm(jacobian, axis=0) * np.linalg.norm(r)
    return float(np.max(np.abs(jacobian.T @ r) / np.maximum(sizes, 1e-150), initial=0.0))


def _part(objective: JointObjective, number: int, force: Array, noise: float, own: Array) -> FittedPart:
    part, alone = objective.joint.parts[number], objective.parts[number]
    m, h = part.measurement, part.hypothesis
    misfit, stated = force - m.force, alone.loss == "weighted"
    white = alone.whiten(misfit)
    sd = m.force_sd
    names = [n.removeprefix(f"{h.material.name}.") for n in h.natural_names]
    values = np.concatenate([h.films(own)[0], own[0, h.material_size : h.curve_size]])
    return FittedPart(
        label=part.label,
        force=force,
        rmse_N=float(np.sqrt(np.mean(misfit**2))),
        max_N=float(np.max(np.abs(misfit))),
        noise_N=noise if sd is None else float(np.sqrt(np.mean(sd**2))),
        stated=stated,
        reduced_chi2=float(np.mean(white**2)) if stated else None,
        parameters={n: float(v) for n, v in zip(names, values, strict=False)},
    )


def _natural(objective: JointObjective, whole: Array, covariance: Array) -> tuple[tuple[str, ...], Array, Array]:
    """(names, values, standard errors) of the natural parameters that are no noise, by d natural / d x."""
    joint = objective.joint
    names = [n for n in joint.natural_names if ".noise." not in n]
    keep = [joint.natural_names.index(n) for n in names]
    values = joint.natural(whole)[0][keep]
    slopes = np.zeros((len(keep), joint.curve.size))
    for j, i in enumerate(joint.curve):
        h = np.zeros_like(whole)
        h[i] = 1e-5
        slopes[:, j] = ((joint.natural(whole + h) - joint.natural(whole - h))[0][keep]) / 2e-5
    held = np.isnan(np.diag(covariance))
    inner = np.where(held[:, None] | held[None, :], 0.0, covariance)
    sds = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", slopes, inner, slopes), 0.0))
    # What moves with a coordinate at its bound has no error to speak of.
    sds[np.any((np.abs(slopes) > 1e-9 * np.abs(values[:, None])) & held, axis=1)] = np.nan
    return tuple(names), values, sds


def _covariance(r: Array, jacobian: Array, free: NDArray[np.bool_]) -> Array:
    """s^2 (J^T J)^-1 of the ``free`` coordinates, nan for the others and without a degree of freedom."""
    k = jacobian.shape[1]
    out, at = np.full((k, k), np.nan), np.flatnonzero(free)
    dof = len(r) - at.size
    if at.size and dof > 0:
        _, s, vt = np.linalg.svd(jacobian[:, at], full_matrices=False)
        root = vt.T / np.maximum(s, 1e-150)
        out[np.ix_(at, at)] = root @ root.T * (r @ r) / dof
    return out
