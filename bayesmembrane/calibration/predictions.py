"""What a run predicts, and its draws do not say by themselves: computed once, stored beside them.

Bands of the curve inside and beyond the fitted range, residuals, the states that the film reaches, the map of its
convexity, its deformed shapes, and what thicker films of the same silicone should do. A report reads this and solves
nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayesmembrane.calibration.beside_paper import BreakPoint
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.convexity import RESTRICTING
from bayesmembrane.physics.form_error import traces
from bayesmembrane.physics.forward import Forward, Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.mechanics.convexity import least_eigenvalue
from bayesmembrane.physics.mechanics.solution import Status
from bayesmembrane.physics.nodes import nodes_of
from bayesmembrane.physics.noise.base import Elsewhere
from bayesmembrane.physics.rigs.base import rig_of

QUANTILES = (0.05, 0.5, 0.95)
DRAWS, SHAPE_DRAWS = 400, 30
INSIDE, OUTSIDE = 60, 40
POINTS = 101
MAP = (161, 101)
FEWEST = 0.5
"""Where fewer than this share of the draws have a force, no band is given."""


@dataclass(frozen=True, eq=False)
class Wanted:
    """What is to be predicted beyond the fitted points.

    up_to : deflection in m up to which the curve is predicted; the whole measured range, or a sixth more, unless given
    rest : points that were not used for the fit
    breaks : break points of specimens of the same silicone, predicted as F(d') = F(d) d'/d
    draws : how many posterior draws at most are followed
    """

    up_to: float | None = None
    rest: Measurement | None = None
    breaks: tuple[BreakPoint, ...] = ()
    draws: int = DRAWS


def rest_of(measurement: Measurement, whole: Measurement | None) -> Measurement | None:
    """The points of ``whole`` beyond the end of ``measurement``; None if there are none."""
    end = float(measurement.deflection.max())
    if whole is None or not whole.deflection.max() > end:
        return None
    return whole.select(whole.deflection > end)


@dataclass(frozen=True, eq=False)
class Predictions:
    """A run in numbers that can be drawn. SI units; Q stands for 5, 50 and 95 %.

    Attributes
    ----------
    at, force, sd : (N,) the fitted points: m, N, and N or nan where the measurement states no noise
    rest_at, rest_force, rest_sd : (R,) points that were not used, the same
    end, full_range : largest deflection that was fitted, and of the whole measurement, m
    deflection, beyond : (G,) m, and True outside the fitted range
    curve, repeat : (Q, G) N, noiseless curve with its form error, and a new measurement of it
    lost : (L, G) share of the draws without a force, one row per reason in ``reasons``
    residual : (Q, N) N, measured minus computed, without form error
    rest_residual : (Q, R) N, measured minus predicted measurement: the noise is in the prediction
    curves_at : (Q, N) N, noiseless curve at the fitted points
    film : (n,) membrane parameters of the draw whose curve is nearest to the median one
    convex : by convexity mode, the share of draws that meet it
    shape_at : (D,) m, deflections of what follows
    state_1, state_2 : (D, M) stretches that the film reaches
    shape_radius, shape_height : (D, P, M) m, deformed radius and height of P draws
    map_1, map_2, eigenvalue : (A,), (B,), (A, B) stretches, and least eigenvalue of the Hessian of W over G d
    break_at, break_thickness, break_force : (S,) m, m, N, observed
    break_predicted, break_lost : (Q, S) N by thickness scaling, (S,) share of the draws without a force there
    specimens : (S,) names
    """

    at: Array
    force: Array
    sd: Array
    rest_at: Array
    rest_force: Array
    rest_sd: Array
    end: float
    full_range: float
    deflection: Array
    beyond: NDArray[np.bool_]
    curve: Array
    repeat: Array
    lost: Array
    reasons: tuple[str, ...]
    residual: Array
    rest_residual: Array
    curves_at: Array
    film: Array
    convex: dict[str, float]
    shape_at: Array
    state_1: Array
    state_2: Array
    shape_radius: Array
    shape_height: Array
    map_1: Array
    map_2: Array
    eigenvalue: Array
    break_at: Array
    break_thickness: Array
    break_force: Array
    break_predicted: Array
    break_lost: Array
    specimens: tuple[str, ...]

    @property
    def has_noise(self) -> bool:
        """Whether the measurement states its own noise."""
        return bool(np.all(np.isfinite(self.sd)))

    @property
    def lost_share(self) -> Array:
        """(G,) share of the draws without a force, for any reason."""
        return np.asarray(self.lost.sum(axis=0))


def predict_draws(
    hypothesis: Hypothesis,
    measurement: Measurement,
    coordinates: ArrayLike,
    wanted: Wanted | None = None,
    seed: int = 0,
    solve: Solve = api.solve,
) -> Predictions:
    """What posterior draws x (S, k) of a hypothesis on a measurement predict: of the same film on the same rig.

    A form error goes on where the data leave it: its conditional process has their mean and width at the fitted points,
    and widens to its own with the distance from them.
    """
    wanted = wanted or Wanted()
    up_to, rest, breaks, draws = wanted.up_to, wanted.rest, wanted.breaks, wanted.draws
    x = _subset(np.atleast_2d(np.asarray(coordinates, dtype=float)), draws, seed)
    end = float(np.max(measurement.deflection))
    last = max(end, up_to if up_to is not None else max(7 / 6 * end, measurement.full_range))
    grid = _grid(end, last)
    rng = np.random.default_rng(seed)

    carried = _Carried(hypothesis, measurement, x, rng, solve)
    here = carried.here
    curve, status = carried.on(measurement, grid)
    reasons = [s for s in Status if s is not Status.OK and np.any(status == s)]
    films = hypothesis.films(x)
    chosen = _representative(here.force)
    shape_at = _shape_deflections(end, max(end, min(last, measurement.full_range)))
    film = hypothesis.material.from_vector(films[chosen])
    some = films[np.linspace(0, len(films) - 1, min(SHAPE_DRAWS, len(films))).astype(int)]
    others = [hypothesis.material.from_vector(p) for p in some]
    states, *shapes = _profiles([film, *others], shape_at, measurement)
    own_sd = measurement.force_sd
    unused = _points(rest)
    rest_force = np.empty((len(x), 0))
    if rest is not None and unused.at.size:
        # Across a strip each reading has its own state.
        rest_force = carried.on(measurement if rest.across is None else rest, unused.at)[0]
    rest_force = rest_force + _total_sd(hypothesis, measurement, x, np.nan_to_num(unused.sd)) * rng.standard_normal(
        rest_force.shape
    )
    broken = np.array([b.deflection for b in breaks])
    at_break = carried.on(measurement, broken)[0] if broken.size else np.empty((len(x), 0))
    thickness = np.array([b.thickness for b in breaks])
    scaled = at_break * (thickness / measurement.specimen.thickness)
    lam1, lam2, eigenvalue = _map(film, states)
    return Predictions(
        at=measurement.deflection,
        force=measurement.force,
        sd=own_sd if own_sd is not None else np.full(len(measurement), np.nan),
        rest_at=unused.at,
        rest_force=unused.force,
        rest_sd=unused.sd,
        end=end,
        full_range=measurement.full_range,
        deflection=grid,
        beyond=grid > end * (1 + 1e-9),
        curve=band(curve),
        repeat=band(curve + _noise_sd(hypothesis, measurement, x, grid) * rng.standard_normal(curve.shape)),
        lost=np.array([np.mean(status == s, axis=0) for s in reasons]).reshape(len(reasons), grid.size),
        reasons=tuple(s.label for s in reasons),
        residual=band(measurement.force - here.force),
        rest_residual=band(unused.force - rest_force),
        curves_at=band(here.force + carried.at_points()),
        film=films[chosen],
        convex={m.name: float(np.mean(m.met(here, hypothesis.material))) for m in RESTRICTING},
        shape_at=shape_at,
        state_1=states[2],
        state_2=states[3],
        shape_radius=np.stack([s[0] for s in shapes], axis=1),
        shape_height=np.stack([s[1] for s in shapes], axis=1),
        map_1=lam1,
        map_2=lam2,
        eigenvalue=eigenvalue,
        break_at=broken,
        break_thickness=thickness,
        break_force=np.array([b.force for b in breaks]),
        break_predicted=band(scaled),
        break_lost=np.mean(~np.isfinite(scaled), axis=0),
        specimens=tuple(b.specimen for b in breaks),
    )


# ---- pieces ----------------------------------------------------------------------------------------------------------


class _Carried:
    """Curves of draws x (B, k) anywhere, each with the form error that its residual at the fitted points tells."""

    def __init__(
        self, hypothesis: Hypothesis, measurement: Measurement, x: Array, rng: np.random.Generator, solve: Solve
    ) -> None:
        self.hypothesis, self.x, self.rng, self.solve = hypothesis, x, rng, solve
        forward = Forward(hypothesis, measurement, measurement.deflection, solve)
        self.here = (nodes_of(forward) or forward)(x)
        self.residual = measurement.force - self.here.force
        bound = hypothesis.noise.bind(measurement)
        self.noise = bound.at(self.here.force, traces(forward, x, self.here.force) if bound.traced else None)

    def on(self, measurement: Measurement, at: Array) -> tuple[Array, NDArray[np.int8]]:
        """Forces (B, G) N and statuses at deflections (G,) m of a film on the rig of ``measurement``."""
        forward = Forward(self.hypothesis, measurement, at, self.solve)
        found = forward(self.x, reached=False)
        shown = traces(forward, self.x, found.force) if self.noise.traced else None
        return found.force + self._error(Elsewhere(forward.path, found.force, shown, forward.places)), found.status

    def at_points(self) -> Array:
        """(B, N) N: the form error at the fitted points."""
        return self._error(None)

    def _error(self, there: Elsewhere | None) -> Array:
        theta = self.hypothesis.noise_coordinates(self.x)
        return self.noise.recurring(self.residual, theta, self.rng, there)


@dataclass(frozen=True)
class _Readings:
    at: Array
    force: Array
    sd: Array


def _points(measurement: Measurement | None) -> _Readings:
    """Deflection, force and stated noise of points, nan without any; none if there is no measurement."""
    if measurement is None:
        return _Readings(*(np.empty(0) for _ in range(3)))
    sd = measurement.force_sd
    return _Readings(
        measurement.deflection, measurement.force, sd if sd is not None else np.full(len(measurement), np.nan)
    )


def _subset(x: Array, draws: int, seed: int) -> Array:
    if len(x) <= draws:
        return x
    return x[np.sort(np.random.default_rng(seed).choice(len(x), draws, replace=False))]


def _grid(end: float, last: float) -> Array:
    """Deflections from near zero to ``last``, ``end`` among them."""
    inside = np.linspace(end / INSIDE, end, INSIDE)
    outside = np.linspace(end, last, OUTSIDE + 1)[1:] if last > end * (1 + 1e-9) else np.empty(0)
    return np.concatenate([inside, outside])


def _shape_deflections(end: float, last: float) -> Array:
    """A third, two thirds and all of the fitted range, and the end of the whole one."""
    at = [end / 3, 2 * end / 3, end]
    return np.array([*at, last] if last > 1.02 * end else at)


def band(values: Array) -> Array:
    """Quantiles (Q, G) of values (B, G) that exist; nan where fewer than `FEWEST` do."""
    if np.all(np.isfinite(values)):  # the same, without a call for each column
        return np.asarray(np.quantile(values, QUANTILES, axis=0))
    out = np.full((len(QUANTILES), values.shape[1]), np.nan)
    enough = np.flatnonzero(np.mean(np.isfinite(values), axis=0) >= FEWEST)
    if enough.size:
        out[:, enough] = np.nanquantile(values[:, enough], QUANTILES, axis=0)
    return out


def _representative(force: Array) -> int:
    """The draw whose curve is nearest to the median curve."""
    middle = np.median if np.all(np.isfinite(force)) else np.nanmedian
    distance = np.sum((force - middle(force, axis=0)) ** 2, axis=1)
    return int(np.argmin(np.where(np.isfinite(distance), distance, np.inf)))


def _noise_sd(hypothesis: Hypothesis, measurement: Measurement, x: Array, at: Array) -> Array:
    """(B, G) N: the measurement's own noise, carried on between and beyond its points, and the inferred one."""
    own = measurement.force_sd
    order = np.argsort(measurement.deflection)
    given = np.zeros(at.size) if own is None else np.interp(at, measurement.deflection[order], own[order])
    return _total_sd(hypothesis, measurement, x, given)


def _total_sd(hypothesis: Hypothesis, measurement: Measurement, x: Array, given: Array) -> Array:
    """(B, G) N: the given noise (G,) and the inferred one of each draw."""
    names = hypothesis.natural_names
    inferred = np.zeros(len(x))
    if "noise.sd" in names:
        inferred = hypothesis.natural(x, measurement)[:, names.index("noise.sd")]
    return np.sqrt(given**2 + inferred[:, None] ** 2)


def _profiles(films: Sequence[Material], at: Array, measurement: Measurement) -> Array:
    """(B, 4, D, M): radius, height, l1 and l2 of each film at each deflection; nan where it has no state."""
    return rig_of(measurement).states_of(films, at, POINTS)


def _map(film: Material, states: Array) -> tuple[Array, Array, Array]:
    """Least eigenvalue of the Hessian over |G d| on stretches that hold the states (4, D, M) with room around them."""
    top = float(np.nanmax(states[2:])) if np.any(np.isfinite(states[2])) else 2.0
    low = float(np.nanmin(states[3])) if np.any(np.isfinite(states[3])) else 1.0
    short = float(np.nanmin(states[2])) if np.any(np.isfinite(states[2])) else 1.0
    l1 = np.linspace(min(0.9, 0.95 * short), max(2.0, 1.12 * top), MAP[0])
    l2 = np.linspace(min(0.7, 0.85 * low), max(2.0, 0.5 * top), MAP[1])
    a, b = np.meshgrid(l1, l2, indexing="ij")
    hessian = film.hessian(a, b)
    gd = abs(float(np.asarray(film.shear_modulus(film.vector)))) or 1.0
    value = least_eigenvalue(hessian[..., 0, 0], hessian[..., 0, 1], hessian[..., 1, 1])
    return l1, l2, np.asarray(value / gd)
