"""From coordinates to the force curve of a hypothesis at the deflections of a measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.composition import Composition, differences, mountings
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.mechanics.convexity import reached_convexity, reached_ellipticity
from bayesmembrane.physics.mechanics.request import Spared
from bayesmembrane.physics.mechanics.solution import Curves, Status
from bayesmembrane.physics.rigs.base import Films, Law, Rig, Trial, rig_of

Solve = api.Solve
"""`mechanics.api.solve`, or something in front of it, as a cache."""

GAPS = 10
"""Between two deflections at which convexity is asked for lies at most this fraction of the whole measured range."""

LONG = 100
"""Curves of more points than this are interpolated, to 1e-6."""
AT_ONCE = 500_000
"""Readings that are computed in one batch."""
COMPOSED = 200_000
"""The same of a batch with effects: they hold a dozen arrays of its size."""
IN_CACHE = 100_000
"""The same of closed forms: nothing but arithmetic, which waits for memory where its arrays are larger."""

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


@dataclass(frozen=True)
class Margins:
    """How far B films are convex: the fields of `Prediction` that are called the same."""

    films: Array
    convexity: Array
    ellipticity: Array
    convexity_at: Array
    ellipticity_at: Array


@dataclass(frozen=True, eq=False)
class Forward:
    """F(delta; x) of one hypothesis on the rig of one measurement, at ``deflection`` (N,) m.

    At the measurement's own deflections the film remembers how the disc was moved; other deflections are one path of
    their own, at the speed of the measurement. Effects and long curves go through the law of the rig, in
    closed form or interpolated to 1e-6. A material of one modulus alone is solved once: F(c) = (c / 1) F(1).
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
        spare: Spared = Spared.NONE,
    ) -> Prediction:
        """Curves of x (B, k); k may leave out the noise.

        Films of the kind ``spare`` get no more effort once they turn out to be such, and stay unexplained.
        ``reached`` False saves the solutions beyond ``deflection``, and the margins are those up to there.
        """
        x = np.atleast_2d(np.asarray(coordinates, dtype=float))
        if self.composes:
            return self._composed(x, sensitivities, reached, spare)
        films = self.hypothesis.films(x)
        if self.hypothesis.material.scales == (1,) and solver == "ritz":
            curves = _scaled(self._unit[int(reached)], films)
        else:
            curves = self.curves(films, self._all if reached else self.deflection, sensitivities, solver, spare)
        n, chained = self.deflection.size, None
        if sensitivities and curves.sensitivity is not None:
            chained = np.einsum("bni,bik->bnk", curves.sensitivity[:, :n], self.jacobian(x))
        # A convex energy with tensions that pull makes the film's energy convex: an indefinite state refutes it.
        lost = np.any(curves.status == Status.INDEFINITE, axis=1)
        whole = (np.where(lost, -np.inf, m) for m in (reached_convexity(curves), reached_ellipticity(curves)))
        margins = *whole, curves.convexity, curves.ellipticity
        return Prediction(self.deflection, curves.force[:, :n], curves.status[:, :n], films, chained, *margins)

    def margins(self, x: Array) -> Prediction | Margins:
        """What a call with x (B, k) says of convexity; effects and interpolation say nothing of it, and are spared.

        A film that has lost ellipticity is not convex either: nothing more is asked of it.
        """
        if not self.composes:
            return self(x, spare=Spared.NOT_ELLIPTIC)
        films = self.hypothesis.films(x)
        theta = x[:, self.hypothesis.material_size : self.hypothesis.curve_size]
        at = self.law(films, theta, reached=True, spare=Spared.NOT_ELLIPTIC)[1]
        return Margins(films, *_least(at), *at)

    # ---- film and effects ------------------------------------------------------------------------------------------

    @cached_property
    def composes(self) -> bool:
        """True where curves come from a film law and the effects around it, and not straight from the solver."""
        return bool(self.hypothesis.effects) or self.deflection.size > LONG or self.rig.closed_form

    @cached_property
    def rig(self) -> Rig:
        """The rig; raises `SettingsError` if no film on it can be predicted."""
        return rig_of(self.measurement)

    @cached_property
    def path(self) -> Motion:
        """How the disc moves: as in the measurement at its own deflections, else through others at its speed."""
        m = self.measurement
        if self._measured:
            return m.path
        path = Motion(self.deflection, None, m.full_range)
        if m.path.time is None:
            return path
        speed = float(np.median(m.path.speed))
        return Motion(self.deflection, np.cumsum(np.maximum(path.steps, 1e-9 * m.full_range)) / speed, m.full_range)

    @cached_property
    def _measured(self) -> bool:
        return np.array_equal(self.deflection, self.measurement.deflection)

    @cached_property
    def composition(self) -> Composition:
        """The effects on the path; raises `SettingsError` for one that cannot occur here."""
        for effect in self.hypothesis.effects:
            if reason := effect.unavailable(self.measurement.rig, self.path):
                raise SettingsError(reason, remedy="leave it out")
        return Composition(self.hypothesis.effects, self.path)

    @cached_property
    def looked_at(self) -> Array:
        """Deflections beyond and between those asked for at which convexity is asked for, too."""
        return beyond(self.deflection, self.measurement.full_range)

    def _composed(self, x: Array, sensitivities: bool, reached: bool, spare: Spared) -> Prediction:
        """As `__call__`, in batches that fit into memory."""
        count = self.hypothesis.curve_size + 1 if sensitivities else 1
        most = IN_CACHE if self.rig.closed_form else COMPOSED
        rows = max(1, most // (count * self.path.deflection.size))
        parts = [self._batch(x[i : i + rows], sensitivities, reached, spare) for i in range(0, max(len(x), 1), rows)]
        if len(parts) == 1:
            return parts[0]
        names = [f.name for f in fields(Prediction) if f.name != "deflection"]
        whole = {n: [getattr(p, n) for p in parts] for n in names}
        joined: dict[str, Any] = {n: None if v[0] is None else np.concatenate(v) for n, v in whole.items()}
        return Prediction(self.deflection, **joined)

    def _batch(self, x: Array, sensitivities: bool, reached: bool, spare: Spared) -> Prediction:
        law = self.law(self.hypothesis.films(x), self.effects(x), sensitivities, reached, spare)
        return self.over(x, law, sensitivities)

    def effects(self, x: Array) -> Array:
        """(B, m) the parameters of the effects of x (B, k)."""
        return x[:, self.hypothesis.material_size : self.hypothesis.curve_size]

    def mountings(self, x: Array) -> list[Array]:
        """Effect parameters (B, m) with which sensitivities at x (B, k) need the films mounted in another way."""
        return mountings(self.composition, self.effects(x))

    def over(
        self,
        x: Array,
        found: tuple[Law, tuple[Array, Array]],
        sensitivities: bool,
        mounted: Sequence[Law] | None = None,
    ) -> Prediction:
        """Curves of x (B, k) over what `law` ``found`` for them, which can vary if sensitivities are asked for.

        mounted : the laws at the `mountings`; found here if they are not given
        """
        (law, at), films, theta = found, self.hypothesis.films(x), self.effects(x)
        slopes = None
        if sensitivities:
            jacobian = self.jacobian(x)[:, :, : self.hypothesis.material_size]
            if mounted is None:
                mounted = [self.law(films, moved)[0] for moved in self.mountings(x)]
            force, status, slopes = differences(self.composition, law, mounted, theta, jacobian)
        else:
            force, status = self.composition(law, theta)
        here = self._here
        slopes = None if slopes is None else slopes[:, here]
        return Prediction(self.deflection, force[:, here], status[:, here], films, slopes, *_least(at), *at)

    def law(
        self,
        films: Array,
        theta: Array,
        sensitivities: bool = False,
        reached: bool = False,
        spare: Spared = Spared.NONE,
    ) -> tuple[Law, tuple[Array, Array]]:
        """The law of ``films`` (B, n) with effect parameters ``theta`` (B, k), and margins (B, M) of its states.

        The margins are those of convexity and of ellipticity, -inf where the film's energy became indefinite.
        """
        trial = Trial(
            self.measurement,
            self.path,
            self.composition.prestretch(theta),
            self.composition.end(theta),
            self.looked_at if reached else np.empty(0),
        )
        return self.rig.law(self._films(films, sensitivities, "ritz", spare), trial)

    def _films(self, films: Array, sensitivities: bool, solver: str, spare: Spared) -> Films:
        return Films(self.hypothesis.material, films, sensitivities, spare, solver, self.solve)

    def film_force(self, films: Array) -> Array:
        """(B, N) N: forces of films (B, n) without effects at ``deflection``; nan where there is none."""
        if not self.composes:
            return self.curves(films, self.deflection).force
        plain = replace(self, hypothesis=replace(self.hypothesis, effects=()))
        rows = max(1, AT_ONCE // plain.path.deflection.size)
        found = []
        for part in [films[i : i + rows] for i in range(0, len(films), rows)] or [films]:
            nothing = np.empty((len(part), 0))
            found.append(plain.composition(plain.law(part, nothing)[0], nothing)[0][:, plain._here])
        return np.concatenate(found)

    @property
    def places(self) -> NDArray[np.int64] | None:
        """(N,) where ``deflection`` lies on `path`; None if it is all of it."""
        return self.measurement.on_path if self._measured else None

    @property
    def _here(self) -> Any:
        return slice(None) if self.places is None else self.places

    def curves(
        self,
        films: Array,
        deflection: Array,
        sensitivities: bool = False,
        solver: str = "ritz",
        spare: Spared = Spared.NONE,
    ) -> Curves:
        """Curves of ``films`` (B, n) without effects at ``deflection`` (N,) m on the rig of the measurement."""
        # What is added to the measured points is solved to see whether the film stays convex there.
        read = None if spare is Spared.NONE else self.deflection.size
        return self.rig.curves(self._films(films, sensitivities, solver, spare), self.measurement, deflection, read)

    def jacobian(self, x: Array) -> Array:
        """d films / d coordinates, (B, n, k), by central differences of fourth order: exact to 1e-12 or so."""
        m, k = self.hypothesis.material_size, self.hypothesis.curve_size
        out = np.zeros((len(x), len(self.hypothesis.material.field_names()), k))
        # All in one call: what a call costs is not its numbers.
        moved = np.arange(-2, 3)[:, None, None, None] * STEP * np.eye(m, x.shape[1])[:, None] + x
        f = self.hypothesis.films(moved.reshape(-1, x.shape[1])).reshape(5, m, len(x), -1)
        out[:, :, :m] = np.moveaxis((8 * (f[3] - f[1]) - (f[4] - f[0])) / (12 * STEP), 0, 2)
        return out


def _least(margins: tuple[Array, Array]) -> tuple[Array, Array]:
    """(B,) each, of margins (B, M)."""
    convexity, ellipticity = (np.fmin.reduce(m, axis=1) for m in margins)
    return convexity, ellipticity


def _scaled(unit: Curves, films: Array) -> Curves:
    """Curves of films of one modulus (B, 1) from the one of modulus one: F(c) = c F(1), dF/dc = F(1)."""
    shape = (len(films), unit.force.shape[1])
    same = {f.name: getattr(unit, f.name) for f in fields(Curves)}
    wide = {k: np.broadcast_to(v, (*shape, *v.shape[2:])) for k, v in same.items() if v is not None}
    return Curves(**{**same, **wide, **{k: films * same[k] for k in ("force", "slope", "energy")}})


def beyond(deflection: Array, full_range: float) -> Array:
    """Deflections that, with those given, leave no gap larger than ``full_range / GAPS`` from 0 to ``full_range``."""
    ends = np.concatenate([[0.0], np.unique(np.abs(deflection)), [full_range]])
    extra = []
    for low, high in pairwise(ends):
        parts = int(np.ceil((high - low) / (full_range / GAPS) - 1e-9))
        extra += [low + (high - low) * i / parts for i in range(1, parts)]
    return np.array([*extra, full_range] if full_range > ends[-2] * (1 + 1e-12) else extra)
