"""From coordinates to the force curve of a hypothesis at the deflections of a measurement."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayesmembrane.errors import SettingsError
from bayesmembrane.hypothesis import Hypothesis
from bayesmembrane.measurement import Measurement
from bayesmembrane.mechanics import api
from bayesmembrane.mechanics.convexity import box_margins, reached_convexity, reached_ellipticity
from bayesmembrane.mechanics.solution import Curves, Status
from bayesmembrane.parameters import Array
from bayesmembrane.rigs.annulus import Annulus

Solve = Callable[..., Curves]
"""`mechanics.api.solve`, or a cache with its signature."""

BOX = (1.0, 8.0)
GAPS = 10
"""Between two deflections at which convexity is asked for lies at most this fraction of the whole measured range."""

STEP = 1e-3  # of the differences in coordinates: h^4 and round-off are both 1e-13 there


@dataclass(frozen=True)
class Prediction:
    """Curves of B draws at N deflections.

    Attributes
    ----------
    deflection : (N,) m
    force : (B, N) N; nan where there is none
    status : (B, N) `Status` codes
    films : (B, n) membrane parameters
    sensitivity : (B, N, k) dF/dx in the coordinates that shape the curve, or None if not asked for
    convexity, ellipticity : (B,) margins over all states reached up to the end of the whole measured range; -inf where
        ellipticity was lost, or the film's energy became indefinite, on the way
    convexity_at, ellipticity_at : (B, M) the same, deflection by deflection; nan where there is no state
    """

    deflection: Array
    force: Array
    status: NDArray[np.int8]
    films: Array
    sensitivity: Array | None
    convexity: Array
    ellipticity: Array
    convexity_at: Array
    ellipticity_at: Array

    @property
    def ok(self) -> NDArray[np.bool_]:
        """(B,) True where the whole curve can be used."""
        return np.asarray(np.all(self.status == Status.OK, axis=1))

    def margin(self, mode: str, hypothesis: Hypothesis) -> Array:
        """(B,) by how much the convexity prior ``mode`` is met: inside means >= 0 (`elliptic`: > 0).

        A film of which nothing is known (no state at all) is inside: its likelihood tells.
        """
        if mode == "none":
            return np.full(len(self.films), np.inf)
        if mode == "box":
            values = box_margins(hypothesis.material, self.films, *BOX)
        else:
            values = self.convexity if mode == "reached" else self.ellipticity
        return np.where(np.isnan(values), np.inf, values)


@dataclass(frozen=True, eq=False)
class Forward:
    """F(delta; x) of one hypothesis on the rig of one measurement, at ``deflection`` (N,) m.

    A material of one modulus alone is solved once: F(c) = (c / 1) F(1).
    """

    hypothesis: Hypothesis
    measurement: Measurement
    deflection: Array
    solve: Solve = api.solve

    @cached_property
    def _all(self) -> Array:
        """The deflections asked for, and those that show convexity up to the end of the whole measured range."""
        return np.concatenate([self.deflection, beyond(self.deflection, self.measurement.full_range)])

    @cached_property
    def _unit(self) -> tuple[Curves, Curves]:
        """The film of modulus one, without and with the helpers."""
        one = np.ones((1, 1))
        return self.curves(one, self.deflection, True), self.curves(one, self._all, True)

    def __call__(
        self,
        coordinates: ArrayLike,
        sensitivities: bool = False,
        reached: bool = True,
        solver: str = "ritz",
        only: str = "all",
    ) -> Prediction:
        """Curves of x (B, k); k may leave out the noise.

        ``only`` "convex" or "elliptic" saves effort on films that turn out not to be so, and leaves them unexplained.
        ``reached`` False saves the solutions beyond ``deflection``, and the margins are those up to there.
        """
        x = np.atleast_2d(np.asarray(coordinates, dtype=float))
        films = self.hypothesis.films(x)
        if self.hypothesis.material.scales == (1,) and solver == "ritz":
            curves = _scaled(self._unit[int(reached)], films)
        else:
            curves = self.curves(films, self._all if reached else self.deflection, sensitivities, solver, only)
        n, chained = self.deflection.size, None
        if sensitivities and curves.sensitivity is not None:
            chained = np.einsum("bni,bik->bnk", curves.sensitivity[:, :n], self.jacobian(x))
        # A convex energy with tensions that pull makes the film's energy convex: an indefinite state refutes it.
        lost = np.any(curves.status == Status.INDEFINITE, axis=1)
        whole = (np.where(lost, -np.inf, m) for m in (reached_convexity(curves), reached_ellipticity(curves)))
        margins = *whole, curves.convexity, curves.ellipticity
        return Prediction(self.deflection, curves.force[:, :n], curves.status[:, :n], films, chained, *margins)

    def curves(
        self, films: Array, deflection: Array, sensitivities: bool = False, solver: str = "ritz", only: str = "all"
    ) -> Curves:
        """Curves of ``films`` (B, n) at ``deflection`` (N,) m on the rig of the measurement."""
        rig = annulus(self.measurement)
        # What lies beyond is solved to see whether the film stays convex there.
        exact = float(np.max(self.deflection)) if only != "all" else np.inf
        options: dict[str, Any] = {"inner_radius": rig.inner_radius, "outer_radius": rig.outer_radius}
        return self.solve(
            self.hypothesis.material,
            films,
            deflection,
            sensitivities=sensitivities,
            solver=solver,
            only=only,
            exact_up_to=exact,
            **options,
        )

    def jacobian(self, x: Array) -> Array:
        """d films / d coordinates, (B, n, k), by central differences of fourth order: exact to 1e-12 or so."""
        k = self.hypothesis.curve_size
        out = np.zeros((len(x), len(self.hypothesis.material.field_names()), k))
        for j in range(self.hypothesis.material_size):
            h = np.zeros(x.shape[1])
            h[j] = STEP
            f = self.hypothesis.films
            out[:, :, j] = (8 * (f(x + h) - f(x - h)) - (f(x + 2 * h) - f(x - 2 * h))) / (12 * h[j])
        return out


def _scaled(unit: Curves, films: Array) -> Curves:
    """Curves of films of one modulus (B, 1) from the one of modulus one: F(c) = c F(1), dF/dc = F(1)."""
    shape = (len(films), unit.force.shape[1])
    same = {f.name: getattr(unit, f.name) for f in fields(Curves)}
    wide = {k: np.broadcast_to(v, (*shape, *v.shape[2:])) for k, v in same.items() if v is not None}
    return Curves(**{**same, **wide, **{k: films * same[k] for k in ("force", "slope", "energy")}})


def predict(
    hypothesis: Hypothesis,
    coordinates: ArrayLike,
    measurement: Measurement,
    deflection: ArrayLike | None = None,
    sensitivities: bool = False,
    solve: Solve = api.solve,
) -> Prediction:
    """Force curves F(delta; x) of coordinates x (B, k) at ``deflection`` (N,) m, or at those of the measurement.

    Raises `SettingsError` if the rig of the measurement is not an annulus.
    """
    at = measurement.deflection if deflection is None else np.atleast_1d(np.asarray(deflection, dtype=float))
    return Forward(hypothesis, measurement, at, solve)(coordinates, sensitivities)


def annulus(measurement: Measurement) -> Annulus:
    """The rig, if it is one whose film can be solved; raises `SettingsError` otherwise."""
    if not isinstance(measurement.rig, Annulus):
        raise SettingsError(f'a film on the rig "{measurement.rig.name}" cannot be predicted', remedy="use an annulus")
    return measurement.rig


def beyond(deflection: Array, full_range: float) -> Array:
    """Deflections that, with those given, leave no gap larger than ``full_range / GAPS`` from 0 to ``full_range``."""
    ends = np.concatenate([[0.0], np.unique(np.abs(deflection)), [full_range]])
    extra = []
    for low, high in pairwise(ends):
        parts = int(np.ceil((high - low) / (full_range / GAPS) - 1e-9))
        extra += [low + (high - low) * i / parts for i in range(1, parts)]
    return np.array([*extra, full_range] if full_range > ends[-2] * (1 + 1e-12) else extra)
