"""The annulus of the paper: a flat ring of film, clamped outside, lifted by a disc that is bonded to it inside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.mechanics.film_law import FilmLaw, film_law
from bayesmembrane.physics.mechanics.request import Request, Spared, request
from bayesmembrane.physics.mechanics.solution import Curves, Status
from bayesmembrane.physics.rigs._ring import Ring
from bayesmembrane.physics.rigs.base import Films, Trial

WIDER = 1.5
"""How much wider a disc could be."""


@dataclass(frozen=True)
class Annulus(Ring):
    """Film between the radii R1 (edge of the disc) and R2 (edge of the clamp), 0 < R1 < R2, in m.

    The disc is lifted by the deflection; deflection and force are positive for a lifted disc.
    """

    name: ClassVar[str] = "annulus"
    title: ClassVar[str] = "clamped annulus with a lifted disc"

    @classmethod
    def example(cls) -> Self:
        """The rig of the paper."""
        return cls(0.010, 0.035)

    @property
    def radius_ratio(self) -> float:
        """R2 / R1."""
        return self.outer_radius / self.inner_radius

    # ---- mechanics -------------------------------------------------------------------------------------------------

    def slack_below_rest(self, measurement: Measurement) -> bool:
        return True

    def law(self, films: Films, trial: Trial) -> tuple[FilmLaw, tuple[Array, Array]]:
        """Solved at a few deflections; margins are -inf where the film's energy became indefinite."""
        end = np.maximum(trial.end, 1e-3 * trial.measurement.full_range)
        count = len(films.parameters)
        asked = Request(
            films.material,
            films.parameters,
            np.broadcast_to(trial.extra, (count, trial.extra.size)),
            np.broadcast_to(trial.prestretch, (count,)),
            self.inner_radius,
            self.outer_radius,
            sensitivities=films.sensitivities,
            spare=films.spare,
            read=None if films.spare is Spared.NONE else 0,
        )
        law, curves = film_law(asked, np.broadcast_to(end, (count,)), films.solve)
        indefinite, bent = (curves.status == s for s in (Status.INDEFINITE, Status.NOT_ELLIPTIC))
        convexity, ellipticity = (
            np.where(indefinite | (bent & np.isnan(m)), -np.inf, m) for m in (curves.convexity, curves.ellipticity)
        )
        return law, (convexity, ellipticity)

    def curves(self, films: Films, measurement: Measurement, deflection: Array, read: int | None = None) -> Curves:
        asked = request(films.material, films.parameters, deflection, self.inner_radius, self.outer_radius)
        asked = replace(asked, sensitivities=films.sensitivities, solver=films.solver, spare=films.spare)
        return films.solve(replace(asked, read=read))

    def states(self, film: Material, deflection: Array, points: int) -> Array:
        return np.asarray(self.states_of([film], deflection, points)[0])

    def states_of(self, films: Sequence[Material], deflection: Array, points: int) -> Array:
        parameters = np.repeat([film.vector for film in films], deflection.size, axis=0)
        at, radii = np.tile(deflection, len(films)), (self.inner_radius, self.outer_radius)
        found = api.profiles(request(type(films[0]), parameters, at[:, None], *radii), points)
        flat = np.stack([np.stack([p.f, p.height, p.l1, p.l2]) for p in found])
        return np.moveaxis(flat.reshape(len(films), deflection.size, 4, points), 2, 1)

    def mean_stretch(self, deflection: float) -> float:
        rise = deflection / (self.outer_radius - self.inner_radius)
        return float(np.sqrt(1.0 + rise * rise))

    def variants(self) -> tuple[tuple[str, Self], ...]:
        """A disc so wide that still a ring of film is left."""
        if WIDER * self.inner_radius >= 0.8 * self.outer_radius:
            return ()
        words = f"with a disc {WIDER:g} times as wide"
        return ((words, replace(self, inner_radius=WIDER * self.inner_radius)),)
