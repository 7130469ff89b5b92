"""What is read of a film with flaws: the drive's errors, the frame's yield, the film, and the load cell's errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tests.generator_three.curves import FilmCurves
from tests.generator_three.elements import NoBalanceError
from tests.generator_three.film_side import Carrying, Scales
from tests.generator_three.flaws import Flaw
from tests.generator_three.journey import Journey
from tests.generator_three.memory import direction_followed, play_operator, relaxation_kernel, stop_operator

SETTLED, ACCEPTED = 1e-7, 1e-5  # of the peak
KEPT, MOVED, TURNS = 0.3, 0.7, 60


@dataclass(frozen=True, eq=False)
class Instrument:
    """A film on a journey, with flaws by name."""

    curves: FilmCurves
    journey: Journey
    flaws: Mapping[str, Flaw]

    @cached_property
    def scales(self) -> Scales:
        """Those of the sound film."""
        energy, peak, film = self.curves.sound.antiderivative(), self.curves.peak, self.curves.film
        force = float(self.curves.sound(peak))
        return Scales(film.outer - film.inner, peak, force, float(energy(peak) - energy(0)))

    @cached_property
    def _kernel(self) -> Any:
        flaw = self.flaws.get("viscoelastic")
        return None if flaw is None else relaxation_kernel(flaw.form, flaw.details, self.journey.time)

    def with_sizes(self, sizes: Mapping[str, float]) -> Instrument:
        """The same film and journey, its flaws of other sizes."""
        flaws = {k: Flaw(k, sizes.get(k, f.size), f.form, f.details) for k, f in self.flaws.items()}
        other = Instrument(self.curves, self.journey, flaws)
        # Neither depends on sizes, and both are costly.
        other.__dict__["scales"], other.__dict__["_kernel"] = self.scales, self._kernel
        return other

    def reading(self, parameters: Sequence[float] | None = None) -> Any:
        """(N,) N without noise; with other parameters of the energy. Raises `NoBalanceError`."""
        with np.errstate(all="ignore"):
            return self._sensed(self._settled(parameters)[1])

    def deflection(self) -> Any:
        """(N,) mm of the film itself."""
        with np.errstate(all="ignore"):
            return self._settled(None)[0]

    def _size(self, name: str) -> float:
        return self.flaws[name].size if name in self.flaws else 0.0

    def _carrying(self, parameters: Sequence[float] | None) -> Carrying:
        p, stretch = parameters or self.curves.rubber.parameters, 1 + self._size("prestretch")
        curve = self.curves.curve(p, stretch)
        return Carrying(
            self.journey,
            self.scales,
            self.flaws,
            {k: f.size for k, f in self.flaws.items()},
            curve,
            curve.antiderivative(),
            self.curves.by_length(p, stretch) if "clamp_slip" in self.flaws else None,
            self._kernel,
            tight=stretch != 1,
        )

    def _settled(self, parameters: Sequence[float] | None) -> tuple[Any, Any]:
        """(deflection of the film, its force), with the frame in balance."""
        carrying, at = self._carrying(parameters), self._driven()
        x, peak = at.copy(), self.scales.peak
        if not self._size("machine_compliance"):
            return x, carrying.force(x)
        for _ in range(TURNS):
            force = carrying.force(x)
            new = at - self._size("machine_compliance") * peak * self._yields(force / self.scales.force)
            change = abs(new - x).max()
            x = KEPT * x + MOVED * new
            if change < SETTLED * peak:
                return x, force
        if change > ACCEPTED * peak:
            raise NoBalanceError("the frame and the film do not settle")
        return x, force

    def _driven(self) -> Any:
        """(N,) mm, where the drive is, not where it says that it is."""
        read, peak = self.journey.at, self.scales.peak
        at = read
        if gap := self._size("backlash") * peak:
            # On the way up the disc is where it is read, from the first reading on: play shows on the way down.
            followed = np.minimum(np.maximum(play_operator(read, gap) + gap, 0), self.curves.grid[-1])
            at = np.where(np.arange(len(read)) < np.argmax(read > gap), read, followed)
        if size := self._size("ripple"):
            flaw = self.flaws["ripple"]
            of, whole = (read, peak) if flaw.form == "screw" else (self.journey.time, self.journey.time[-1])
            at = at + size * peak * np.sin(2 * np.pi * (of / (flaw.details["period"] * whole)))
        return at - self._size("zero_offset") * peak

    def _yields(self, part: Any) -> Any:
        """(N,) what the frame yields at these parts of the largest force, 1 being what it yields at 1 if linear."""
        flaw = self.flaws["machine_compliance"]
        if flaw.form == "hardening":
            return part / (1 + flaw.details["h"] * abs(part))
        if flaw.form == "power":
            # Linear below a thousandth: the slope of a power at zero has no bound.
            return np.sign(part) * abs(part) * np.maximum(abs(part), 1e-3) ** (flaw.details["q"] - 1)
        return part

    def _sensed(self, force: Any) -> Any:
        """(N,) N that the load cell makes of the film's force."""
        top, whole = self.scales.force, self.journey.time[-1]
        if size := self._size("friction"):
            rubbed = size * top * self._rubbed()
            force = force + rubbed * (
                1 + self.flaws["friction"].details["mu"] * abs(force) / top if self._by_load else 1
            )
        force = force + self._size("force_offset") * top
        if size := self._size("force_drift"):
            flaw = self.flaws["force_drift"]
            force = force + size * top * _DRIFTS[flaw.form](self.journey.time / whole, flaw.details["tau"])
        if size := self._size("temperature_step"):
            d = self.flaws["temperature_step"].details
            since = self.journey.time / whole - d["t0"]
            warmed = 1 - np.exp(-np.maximum(since, 0) / (d["rise"] + 1e-6))
            force = force + size * top * np.where(since > 0, warmed, 0)
        if size := self._size("clipped"):
            force = np.minimum(force, (1 - size) * top)
        return force

    @property
    def _by_load(self) -> bool:
        return self.flaws["friction"].form == "load"

    def _rubbed(self) -> Any:
        """(N,) from -1 to 1, against the motion."""
        flaw = self.flaws["friction"]
        length = flaw.details["dc"] * self.scales.peak
        if flaw.form == "dahl":
            return direction_followed(self.journey.at, length)
        return stop_operator(self.journey.at, length) / length


_DRIFTS: dict[str, Callable[[Any, float], Any]] = {
    "linear": lambda part, tau: part,
    "saturating": lambda part, tau: (1 - np.exp(-part / tau)) / (1 - np.exp(-1 / tau)),
    "sqrt": lambda part, tau: np.sqrt(part),
}
