"""How people see a curve: which quantities and units its rig shows, and whether its points were measured at all."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from bayesmembrane.data.fixture import Fixture
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.parameters import Array
from bayesmembrane.words.language import digits, newtons, three_digits

if TYPE_CHECKING:
    from bayesmembrane.calibration.fit import Fit
    from bayesmembrane.valleys.result import Valley

Kind = TypeVar("Kind")

MEASURED = "measured"
FORCE = "force"
BARE = "-"
"""The unit of a number without one."""
_NOT_MEASURED = ("reconstructed", "synthetic", "simulated")


def made(origin: str) -> str:
    """``measured``, or how else the points came about: the first word of their statement of origin."""
    first = re.match(r"\W*(?:statement\W+)?(\w+)", origin)
    word = first[1].lower() if first else ""
    return word if word in _NOT_MEASURED else MEASURED


@dataclass(frozen=True)
class Seen:
    """Value shown = ``rest`` + factor times SI, for deflections (m) and forces (N).

    travel, load : "deflection" and "force", or of a homogeneous test what its rig calls them: "stretch" and "stress"
    small : (factor, unit) of what a model leaves of the forces
    origin : "measured", "reconstructed", "synthetic", ...
    """

    travel: str
    travel_scale: tuple[float, str]
    rest: float
    load: str
    load_scale: tuple[float, str]
    small: tuple[float, str]
    origin: str = MEASURED

    @property
    def bare(self) -> bool:
        """True if deflections are seen as numbers without a unit: stretch, compression, shear."""
        return self.travel_scale[1] == BARE

    @property
    def units(self) -> tuple[str, ...]:
        """What is on the axes, and in which units: two strips have the same, however thick they are."""
        return self.travel, self.travel_scale[1], self.load, self.load_scale[1], self.small[1]

    def along(self, deflection: Array) -> Array:
        """(N,) what is on the horizontal axis."""
        return self.rest + self.travel_scale[0] * deflection

    def meant(self, shown: float) -> float:
        """The deflection in m that is at this value on the horizontal axis."""
        return (shown - self.rest) / self.travel_scale[0]

    def carried(self, force: Array) -> Array:
        """(N,) what is on the vertical axis."""
        return self.load_scale[0] * force

    def left(self, residual: Array) -> Array:
        """(N,) residuals as they are drawn."""
        return self.small[0] * residual

    def error(self, value: float) -> str:
        """A residual in N in words: ``4.02 mN``."""
        return f"{three_digits(self.small[0] * value)} {self.small[1]}"

    def force(self, value: float) -> str:
        """A force in N in words, three digits: mN below 0.1 N; of a strip its stress."""
        if self.load == FORCE:
            return newtons(value)
        return (
            f"{digits(self.load_scale[0] * value)} {self.load_scale[1]}" if math.isfinite(value) else f"no {self.load}"
        )

    def loss(self, value: float, count: int = 4) -> str:
        """A loss in N, in the unit of the vertical axis, with so many digits."""
        return f"{self.load_scale[0] * value:.{count}g} {self.load_scale[1]}"

    def place(self, deflection: float) -> str:
        """A deflection in m in words, to follow "up to": ``30 mm``, ``a stretch of 2.5``."""
        value = self.rest + self.travel_scale[0] * deflection
        return f"a {self.travel} of {value:.4g}" if self.bare else f"{value:.4g} {self.travel_scale[1]}"

    @property
    def curve(self) -> str:
        """``force curve``, ``reconstructed stress curve``."""
        return f"{self.load} curve" if self.origin == MEASURED else f"{self.origin} {self.load} curve"

    @property
    def travel_label(self) -> str:
        return f"{self.travel} ({self.travel_scale[1]})"

    @property
    def load_label(self) -> str:
        return f"{self.load} ({self.load_scale[1]})"

    @property
    def left_label(self) -> str:
        return f"{self.origin} less fitted ({self.small[1]})"


DISC = Seen("deflection", (1e3, "mm"), 0.0, "force", (1.0, "N"), (1e3, "mN"))
"""A lifted disc, measured."""


def in_one_unit(every: Iterable[Kind], how: Callable[[Kind], Seen]) -> list[list[Kind]]:
    """Those that one table or picture can show, together: all that are read in the same units, by ``how`` each is seen.

    The groups are in the order of their first, and each value is still to be shown by the factors of its own test.
    """
    groups: dict[tuple[str, ...], list[Kind]] = {}
    for one in every:
        groups.setdefault(how(one).units, []).append(one)
    return list(groups.values())


def seen_on(rig: Fixture, thickness: float, origin: str = "") -> Seen:
    """How a curve on this rig is seen; ``origin`` is the statement of where its points come from."""
    shown = rig.shown(thickness)
    if rig.homogeneous:
        travel, rest, load = rig.axes
        return Seen(travel, (shown["m"][0], BARE), rest, load, shown["N"], shown["N"], made(origin))
    travel, rest, load = rig.axes
    return Seen(travel, shown["m"], rest, load, (1.0, "N") if load == FORCE else shown["N"], shown["N"], made(origin))


def seen_by_fit(found: Fit) -> Seen:
    """How the curve of a fit is seen; one whose rig is not known as that of a lifted disc."""
    return DISC if found.rig is None else seen_on(found.rig, found.thickness, found.origin)


def seen_by_valley(found: Valley) -> Seen:
    """How the curve of a valley is seen; one whose rig is not known as that of a lifted disc."""
    return DISC if found.rig is None else seen_on(found.rig, found.thickness)


def seen(measurement: Measurement) -> Seen:
    """How this measurement is seen."""
    return seen_on(measurement.rig, measurement.specimen.thickness, measurement.provenance.origin)
