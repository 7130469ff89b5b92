"""What least squares minimises: residuals of many films at once, weighted or not, with exact slopes."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares

from bayesmembrane.calibration.prior import JointPrior
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import SettingsError, unknown_name
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.forward import Forward, Prediction, Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.rigs.base import rig_of

LOSSES = ("euclidean", "weighted")
SCREENED, INFLATED = 1024, 0.25  # draws that are looked at, and the part of them from a wider prior
INFLATION = 2.5
MOST, SLOPES = 300, 5000  # evaluations of one search, and slopes: an evaluation costs one for each coordinate
ON_THE_WAY = 24  # states at which a film is looked at before it is solved


class _LevelError(Exception):
    """The loss is level at ``x`` (k,), as where the film is slack at every point: no step can be made from there."""

    def __init__(self, x: Array) -> None:
        super().__init__()
        self.x = x


class Objective:
    """r(x) = L^-1 (F(x) - y) of coordinates that shape the curve, with its Jacobian."""

    def __init__(self, hypothesis: Hypothesis, measurement: Measurement, loss: str, solve: Solve) -> None:
        if loss not in LOSSES:
            raise unknown_name("loss", loss, LOSSES)
        if loss == "weighted" and measurement.force_sd is None:
            raise SettingsError(
                'the loss "weighted" needs the noise of the measurement, and it states none',
                remedy='give force_sd_N in the specimen file, or use "euclidean"',
            )
        hypothesis = hypothesis.on(measurement)
        self.hypothesis, self.measurement, self.loss = hypothesis, measurement, loss
        weighted, covariance = loss == "weighted", measurement.covariance
        self.root = np.linalg.cholesky(covariance) if weighted and covariance is not None else None
        self.sd = measurement.force_sd if weighted and covariance is None else None
        self.forward = Forward(hypothesis, measurement, measurement.deflection, solve)
        self.parameters = hypothesis.parameters[: hypothesis.curve_size]
        self.low, self.high = np.array([p.bounds for p in self.parameters], dtype=float).T
        self._last: tuple[Array, Array, Array] | None = None

    def whiten(self, r: Array) -> Array:
        """L^-1 r along the first axis of r (N, ...)."""
        if self.sd is not None:  # independent noise: a matrix of a long measurement would not fit into memory
            return np.asarray(r / self.sd.reshape(-1, *[1] * (r.ndim - 1)))
        return r if self.root is None else np.asarray(solve_triangular(self.root, r, lower=True, check_finite=False))

    def batch(self, x: Array) -> tuple[Array, Array]:
        """r (B, N) and J (B, N, k) of x (B, k); nan where there is no curve."""
        p = self.forward(x, sensitivities=True, reached=False)
        assert p.sensitivity is not None
        r, j = p.force - self.measurement.force, p.sensitivity
        if self.root is None and self.sd is None:
            return r, j
        wide = np.concatenate([r[:, :, None], j], axis=2)
        white = self.whiten(np.moveaxis(wide, 1, 0).reshape(r.shape[1], -1))
        white = np.moveaxis(white.reshape(r.shape[1], *wide.shape[::2]), 0, 1)
        return white[:, :, 0], white[:, :, 1:]

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """(r (N,), J (N, k)) of one x (k,), remembered: a search asks for them one after the other.

        A film whose slopes are not all numbers has no r either: no search may start there or step there.
        """
        if self._last is None or not np.array_equal(self._last[0], x):
            r, j = self.batch(x[None, :])
            known = np.all(np.isfinite(j[0]))
            self._last = (x.copy(), r[0] if known else np.full_like(r[0], np.nan), j[0])
        return self._last[1], self._last[2]

    def many(self, prediction: Prediction) -> Array:
        """|r| (B,); inf where there is no curve."""
        size = np.linalg.norm(self.whiten((prediction.force - self.measurement.force).T), axis=0)
        return np.where(np.isnan(size), np.inf, size)

    def rescaled(self, films: Array) -> tuple[Array, Array]:
        """Coordinates (M, k) of the films (B, n) that reach the data, at the modulus that fits best, and |r| (M,).

        F(s c) = s F(c), so that s = <F, y> / <F, F> is exact.
        """
        scales = np.asarray(self.hypothesis.material.scales)
        force = self.whiten(self.forward.film_force(films).T)
        y = self.whiten(self.measurement.force)
        with np.errstate(all="ignore"):
            s = y @ force / np.sum(force**2, axis=0)
            size = np.linalg.norm(s * force - y[:, None], axis=0)
            x = self.hypothesis.material.to_coordinates((films * np.where(scales == 1, s[:, None], 1.0)).T).T
            n = x.shape[1]
            good = np.all((x >= self.low[:n]) & (x <= self.high[:n]), axis=1) & (s > 0) & np.isfinite(size)
        return x[good], size[good]

    def pool(self, rng: np.random.Generator, draws: int = SCREENED) -> tuple[Array, Array]:
        """Rescaled draws (M, k) and |r| (M,), the best first: of the prior and of a wider one, or of the bounds."""
        n, k = self.hypothesis.material_size, self.hypothesis.curve_size
        prior = JointPrior(self.hypothesis).draw(rng, draws)[:, :k]
        wide = prior[draws - int(draws * INFLATED) :]
        wide[:] = self.centre + INFLATION * (wide - self.centre)
        anywhere = rng.uniform(self.low, self.high, prior.shape)
        for candidates in (np.clip(prior, self.low, self.high), anywhere):
            films = self.hypothesis.films(candidates)
            start, size = self.rescaled(films[self._likely(films)])
            if len(start):
                # Draws of the effects are independent of those of the material: any of them will do.
                start = np.concatenate([start, candidates[: len(start), n:]], axis=1)
                order = np.argsort(size, kind="stable")
                return start[order], size[order]
        raise self._refusal(films)

    def _refusal(self, films: Array) -> SettingsError:
        """Why none of the films (B, n) is a start: none reaches the deflections, or none the forces."""
        force, y = self.forward.film_force(films), self.measurement.force
        force = force[np.all(np.isfinite(force), axis=1)]
        label, far = self.hypothesis.label(), f"{1e3 * np.max(self.measurement.deflection):g} mm"
        if not len(force):
            return SettingsError(
                f"no {label} film with admissible parameters reaches {far}",
                remedy="use a shorter range or another material, and check the units of the deflection",
            )
        if not np.any(y):
            return SettingsError("all forces are zero", remedy="use a curve that was measured")
        least, most = (float(np.exp(v[0])) for v in (self.low, self.high))
        return SettingsError(
            f"no {label} film with a shear modulus times thickness of {least:.2g} to {most:.2g} N/m carries "
            f"{np.max(y):.3g} N at {far}",
            remedy="check the units and signs of deflection and force",
        )

    def _likely(self, films: Array) -> NDArray[np.bool_]:
        """(B,) True where P1 > 0 and P11 > 0 on l2 = 1 up to the mean meridional stretch at the largest deflection.

        Films without are told late, and hardly ever reach the data: they are not worth a solution in a search.
        """
        mean = rig_of(self.measurement).mean_stretch(float(np.max(np.abs(self.measurement.deflection))))
        if mean is None:
            return np.ones(len(films), bool)
        stretch = np.linspace(1.0, mean, ON_THE_WAY + 1)[1:, None]
        with np.errstate(all="ignore"):
            _, p1, _, p11, _, _ = self.hypothesis.material.derivatives(
                films.T[:, None, :], stretch, np.ones_like(stretch)
            )
        return np.asarray(np.all((p1 > 0) & (p11 > 0), axis=0))

    @cached_property
    def centre(self) -> Array:
        """Prior medians (k,)."""
        return np.array([float(p.prior.quantile(0.5)) for p in self.parameters])

    @cached_property
    def spread(self) -> Array:
        """Prior standard deviations (k,): the scale on which starts lie apart."""
        return np.array([p.prior.mean_sd[1] for p in self.parameters])

    def polish(self, x: Array, evaluations: int = MOST, tolerance: float = 1e-8) -> tuple[Array, float, str]:
        """(x, |r|, status) after a trust-region search from x (k,); |r| is inf where x has no curve or no slopes.

        Of many coordinates fewer evaluations are made: `SLOPES` over their number, at least a third of `MOST`.
        """
        room = 1e-6 * (self.high - self.low)
        start = np.clip(x, self.low + room, self.high - room)
        if not np.all(np.isfinite(self(start)[0])):
            return start, np.inf, "no curve at the start"
        try:
            done = least_squares(
                self._residual,
                start,
                jac=self._slope,
                bounds=(self.low, self.high),
                x_scale="jac",
                ftol=tolerance,
                xtol=tolerance,
                gtol=None,
                max_nfev=min(evaluations, max(SLOPES // x.size, MOST // 3)),
            )
        except _LevelError as level:
            return level.x, float(np.linalg.norm(self(level.x)[0])), "converged"
        return done.x, float(np.sqrt(2 * done.cost)), "converged" if done.status > 0 else "evaluation limit"

    def _residual(self, x: Array) -> Array:
        return self(x)[0]

    def _slope(self, x: Array) -> Array:
        r, jacobian = self(x)
        if not np.any(r @ jacobian):  # least_squares would divide zero by zero, and go on with nan
            raise _LevelError(x.copy())
        return jacobian


def separated(pool: Array, distance: Array, count: int) -> list[Array]:
    """The first ``count`` rows of pool (M, k) that lie further from each other than ``distance`` (k,)."""
    chosen: list[Array] = []
    for x in pool:
        if all(np.max(np.abs(x - c) / distance) > 1 for c in chosen):
            chosen.append(x)
        if len(chosen) == count:
            break
    return chosen
