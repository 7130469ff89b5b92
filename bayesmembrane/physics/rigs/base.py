"""What a test rig declares beside its `Fixture`: the forces of a film on it. One file per rig, found by its name."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np

from bayesmembrane.data.fixture import Fixture, check_deviations, check_sequence
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.errors import DataError, SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import component
from bayesmembrane.ground.units import FORCE, RATIO, STRESS
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.mechanics.request import Spared
from bayesmembrane.physics.mechanics.solution import Curves
from bayesmembrane.physics.mechanics.strip_law import StripLaw, strip_curves, strip_margins

Law = Any
"""(deflection (B, N), excess (B, N) or None) -> (force (B, N), slope (B, N)), as `FilmLaw` and `StripLaw` are."""

PUSHED = 0.01  # of the largest force: a negative one beyond it is no noise about the zero of a slack film
ABOVE_REST = 0.02  # of the largest compression: so far above rest a test in compression may start
SIDE = 0.1  # of the farther one: a side that goes less far from rest may be a zero that is off
STATES = 40  # at which a closed form is asked for its convexity


@dataclass(frozen=True, eq=False)
class Films:
    """B films of one energy, and what is asked of them.

    material, parameters : class of the energy, and membrane parameters (B, n)
    sensitivities : whether derivatives with respect to the parameters are asked for
    spare : films on which no more effort is to be spent
    solver, solve : which solver, and what stands in front of it
    """

    material: type[Material]
    parameters: Array
    sensitivities: bool = False
    spare: Spared = Spared.NONE
    solver: str = "ritz"
    solve: api.Solve = api.solve


@dataclass(frozen=True, eq=False)
class Trial:
    """A way in which films are tested on a rig.

    measurement : the test, whose forces tell whether its specimen was a block that bears compression
    path : how the rig is moved; may be another way than that of the measurement
    prestretch : (B,) of the films as mounted
    end : (B,) m, the largest deflection that each film sees
    extra : (E,) m, deflections beyond the path at which convexity is asked for, too
    """

    measurement: Measurement
    path: Motion
    prestretch: Array = field(default_factory=lambda: np.ones(1))
    end: Array = field(default_factory=lambda: np.ones(1))
    extra: Array = field(default_factory=lambda: np.empty(0))


class Rig(Fixture, ABC):
    """A fixture on which forces can be predicted.

    closed_form : its law costs next to nothing; else films are solved at few points, and a law is drawn through them
    reads_force : what is read grows in proportion to the modulus, as forces and stresses do
    proposal : "" or, in words, the test that could be made on such a rig with another specimen of the same film
    """

    closed_form: ClassVar[bool] = False
    reads_force: ClassVar[bool] = True
    proposal: ClassVar[str] = ""

    @abstractmethod
    def law(self, films: Films, trial: Trial) -> tuple[Law, tuple[Array, Array]]:
        """F(delta) of the films, and margins (B, M) of convexity and of ellipticity of the states on their way.

        The law knows ``status`` (B,) where it is nan, ``varied`` (by changes of the parameters) and ``stack``.
        """

    @abstractmethod
    def curves(self, films: Films, measurement: Measurement, deflection: Array, read: int | None = None) -> Curves:
        """Curves of the films at ``deflection`` (N,) m; beyond the first ``read`` only their stability matters."""

    @abstractmethod
    def states(self, film: Material, deflection: Array, points: int) -> Array:
        """(4, D, points): place along the film (m), height (m), l1, l2 at each of ``deflection`` (D,) m, or nan."""

    def states_of(self, films: Sequence[Material], deflection: Array, points: int) -> Array:
        """(B, 4, D, points): `states` of several films of one energy; a rig may have a quicker way to all of them."""
        return np.stack([self.states(film, deflection, points) for film in films])

    def slack_below_rest(self, measurement: Measurement) -> bool:
        """True if a specimen without effects carries nothing at deflections of zero and less."""
        return False

    def mean_stretch(self, deflection: float) -> float | None:
        """The stretch along the film, on average, at a deflection (m), if across it is about 1; else None."""
        return None

    def variants(self) -> tuple[tuple[str, Self], ...]:
        """Like rigs on which the same test would tell more: ("with ...", rig)."""
        return ()

    @classmethod
    def proposed(cls, stretch: Array) -> tuple[Array, tuple[int, ...]]:
        """(l2 (N,), (1,) or (1, 2)): stretch across and measured tensions of the test that ``proposal`` names."""
        raise SettingsError(f'the rig "{cls.name}" proposes no test', remedy="ask those that have a proposal")


def rig_of(measurement: Measurement) -> Rig:
    """The rig of a measurement; raises `SettingsError` if it is a fixture without mechanics."""
    rig = measurement.rig
    if not isinstance(rig, Rig):
        raise SettingsError(f'a film on the rig "{rig.name}" cannot be predicted', remedy="use a rig that has a law")
    return rig


class Homogeneous(Rig, ABC):
    """A specimen deformed alike everywhere: its deflection is ``length`` times what deforms it, its force the nominal
    stress times ``width`` times thickness; where the specimen file gives none, they are 50 mm and 10 mm.
    """

    length: float
    width: float
    noise: ClassVar[Mapping[str, str]] = {"force_sd": FORCE, "nominal_stress_sd": STRESS}
    homogeneous: ClassVar[bool] = True
    closed_form: ClassVar[bool] = True

    def check(self) -> None:
        """Any length goes with any width."""

    def size(self) -> float:
        return self.length

    def newton(self, quantity: str, thickness: float) -> float:
        return self.width * thickness if quantity == STRESS else 1.0

    def stated(self, found: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        """``force_sd`` (N,) N, if a column states it in whatever quantity; raises `DataError` if two do."""
        names = [k for k in self.noise if k in found]
        if len(names) > 1:
            raise DataError(f"the columns {' and '.join(names)} both give the noise", remedy="remove one of them")
        if not names:
            return {}
        return {"force_sd": found[names[0]] * self.newton(self.noise[names[0]], thickness)}

    def shown(self, thickness: float) -> Mapping[str, tuple[float, str]]:
        """Nominal stress, force over width and thickness, and what deforms it: as measured, whatever the size."""
        MPa = 1e-6 / (self.width * thickness)
        return {
            "m": (1 / self.length, f"in {self.axes[0]}"),
            "m/N": (1 / (self.length * MPa), "1/MPa"),
            "N": (MPa, "MPa"),
            "N/s": (MPa, "MPa/s"),
        }

    def remark_on_units(self, thickness: float) -> str:
        shown = self.shown(thickness)
        return (
            f"forces are nominal stress times width times thickness, 1 N for {shown['N'][0]:.4g} MPa, and 1 mm of "
            f"deflection is {1e-3 * shown['m'][0]:.4g} of {self.axes[0]}; where the specimen file gives no length and "
            "width, 50 mm and 10 mm are taken, and no stress depends on them"
        )

    def filed(self, deflection: float) -> tuple[str, str]:
        """What a file calls a deflection in m, and its value there: ("stretch", "1.2")."""
        return self.axes[0], f"{self.axes[1] + deflection / self.length:g}"

    def place(self, deflection: float) -> str:
        return f"a {self.axes[0]} of {self.axes[1] + deflection / self.length:.3g}"


class Strip(Homogeneous, ABC):
    """A homogeneous test: one stretch l, read as the deflection L (l - 1), gives the nominal stress P1 / thickness.

    The force is the nominal stress times width times thickness, so that deflections and forces are those of a specimen
    of this length and width; where the specimen file gives none, 50 mm and 10 mm.
    """

    columns: ClassVar[Mapping[str, str]] = {"stretch": RATIO, "nominal_stress": STRESS}
    axes: ClassVar[tuple[str, float, str]] = ("stretch", 1.0, "stress")
    pressed: ClassVar[str] = ""
    """The kind of this test where the specimen is pressed and not pulled, if there is one."""

    @staticmethod
    @abstractmethod
    def lateral(stretch: Array, across: Array | None = None) -> tuple[Array, Array]:
        """(l2, dl2/dl) at stretches l (B, N); ``across`` (N,) is l2 where it was measured."""

    # ---- mechanics -------------------------------------------------------------------------------------------------

    def law(self, films: Films, trial: Trial) -> tuple[StripLaw, tuple[Array, Array]]:
        law = self._law(films, trial.measurement, trial.path.across)
        at = trial.path.deflection
        if law.across is None:
            at = np.unique(np.concatenate([at, trial.extra]))
            if at.size > STATES:  # what is asked of a long curve does not hang on where its readings lie
                at = np.linspace(at[0] if law.pushes else 0.0, at[-1], STATES)
        return law, strip_margins(law, at)

    def curves(self, films: Films, measurement: Measurement, deflection: Array, read: int | None = None) -> Curves:
        across = measurement.path.across
        if across is not None and deflection.size == len(measurement):  # the path may hold more points
            across = measurement.across
        return strip_curves(self._law(films, measurement, across), deflection, films.sensitivities)

    def slack_below_rest(self, measurement: Measurement) -> bool:
        return not _pushes(measurement)

    def _law(self, films: Films, measurement: Measurement, across: Array | None) -> StripLaw:
        return StripLaw(films.material, films.parameters, self, _pushes(measurement), across)

    def states(self, film: Material, deflection: Array, points: int) -> Array:
        l1 = np.repeat(1.0 + deflection[:, None] / self.length, points, axis=1)
        along = np.linspace(0.0, self.length, points)
        return np.stack([l1 * along, 0.0 * l1, l1, self.lateral(l1)[0]])

    @classmethod
    def proposed(cls, stretch: Array) -> tuple[Array, tuple[int, ...]]:
        return cls.lateral(stretch)[0], (1,)

    # ---- readings --------------------------------------------------------------------------------------------------

    def as_read(self, found: Mapping[str, Array]) -> Fixture:
        """Where no stretch is above 1 and the stress pushes, the rig on which such a specimen is pressed."""
        if not self.pressed or not only_pressed(found["stretch"]) or float(np.sum(found["nominal_stress"])) >= 0:
            return self
        kind: type[Fixture] = component("rigs", self.pressed)
        return kind(**self.lengths)

    def from_columns(self, found: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        rest = {k: v for k, v in found.items() if k not in self.columns and k not in self.noise}
        deflection = self.length * (found["stretch"] - 1.0)
        out = {**rest, "deflection": deflection, "force": found["nominal_stress"] * self.width * thickness}
        return out | self.stated(found, thickness)

    def check_readings(self, columns: Mapping[str, Array], file: str, lines: Sequence[int]) -> None:
        """What pushes has a stretch below 1 and a negative stress, and something must pull."""
        places = [f"{file}, line {k}" for k in lines]
        deflection, force, across = columns["deflection"], columns["force"], columns.get("across")
        pulled, pushed = deflection > 0, deflection < 0
        if across is not None:
            places = 2 * places
        elif np.any(pulled):  # else the signs come first: pressed, its order is another one
            check_sequence(columns, places, self.filed)
        if across is not None:  # held wide a film pulls below rest, and held narrow it may push above
            pulled, pushed = pulled & (across >= 1), pushed & (across <= 1)
        against = ((pulled & (force < 0)) | (pushed & (force > 0))) & (np.abs(force) > 0.01 * np.max(np.abs(force)))
        if np.sum(against) > 0.5 * np.sum(pulled | pushed):
            k = int(np.argmax(against))
            fault = "at most points the stress is negative above a stretch of 1 or positive below it"
            remedy = "write the stretch as length over length at rest, and the stress positive where it pulls"
            if self.pressed and not np.any(pulled):
                remedy += f', or say kind = "{self.pressed}" if it is positive where it pushes'
            raise DataError(fault, places[k], remedy)
        if across is None:
            _check_sides(deflection, force, places)
        if not np.any(deflection > 0):
            fault = "no stretch is above 1, and this rig only pulls"
            raise DataError(fault, file, "keep the signs as they are, and add the readings in tension of this rubber")
        check_deviations(columns, places)

    def to_columns(self, arrays: Mapping[str, Array], thickness: float) -> dict[str, Array]:
        out = {"time_s": arrays["time"]} if "time" in arrays else {}
        out["stretch"] = 1.0 + arrays["deflection"] / self.length
        out["nominal_stress_MPa"] = 1e-6 * arrays["force"] / (self.width * thickness)
        return out | ({"force_sd_N": arrays["force_sd"]} if "force_sd" in arrays else {})


def _check_sides(deflection: Array, force: Array, places: Sequence[str]) -> None:
    """Raise `DataError` for a side of rest, pulled or pressed, on which every stress (N,) has the wrong sign."""
    found = wrong_side(deflection, force)
    if found is None:
        return
    side, row = found
    where, wrong, done = ("above", "negative", "pulled") if side > 0 else ("below", "positive", "pressed")
    fault = f"every stress {where} a stretch of 1, where the specimen is {done}, is {wrong}"
    remedy = "in a test that goes both ways write the stress positive where it pulls and negative where it pushes"
    raise DataError(fault, places[row], remedy)


def wrong_side(deflection: Array, force: Array) -> tuple[int, int] | None:
    """(1 or -1, first row) of a side of rest on which every force (N,) that counts is against the deflection (N,)."""
    told = np.abs(force) > 0.01 * np.max(np.abs(force))
    for side in (1, -1):
        there = told & (side * deflection > 0)
        far = np.max(side * deflection) > SIDE * np.max(np.abs(deflection))
        carries = np.sum(there) > 0.5 * np.sum(side * deflection > 0)
        if far and carries and np.all(side * force[there] < 0):
            return side, int(np.argmax(there))
    return None


def only_pressed(stretch: Array) -> bool:
    """True if the stretches (N,) lie below 1, but for what is noise about the rest."""
    above, below = float(np.max(stretch)) - 1.0, 1.0 - float(np.min(stretch))
    return above <= ABOVE_REST * below


def _pushes(m: Measurement) -> bool:
    """True where the specimen was compressed, and pushed back: it was a block, not a film."""
    if m.across is not None:  # held across, a film may be taut below rest: only the stress tells
        return bool(np.any(m.force < -PUSHED * np.max(np.abs(m.force))))
    return bool(np.any((m.deflection < -0.01 * m.full_range) & (m.force < 0)))
