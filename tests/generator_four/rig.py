"""What is read of a film with faults: drive, hook, frame, film, guide and load cell, in this order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from tests.generator_four import cell_laws, film_laws, loss_laws
from tests.generator_four.courses import DriveCourse
from tests.generator_four.faults import DEFLECTION, FAULTS, FORCE, LENGTH, FaultAtWork
from tests.generator_four.film_laws import CarriedLoad, FilmScales, LengthenedCone
from tests.generator_three.curves import FilmCurves
from tests.generator_three.elements import NoBalanceError

TURNS, SETTLED, ACCEPTED = 40, 1e-8, 1e-5  # of the largest deflection


@dataclass(frozen=True, eq=False)
class LiftingRig:
    """A film on a course, with faults by name."""

    curves: FilmCurves
    course: DriveCourse
    flaws: Mapping[str, FaultAtWork]

    @cached_property
    def top(self) -> float:
        """N, the sound film's largest force."""
        return float(self.curves.sound(self.curves.peak))

    @cached_property
    def _scales(self) -> FilmScales:
        stored, peak = self.curves.sound.antiderivative(), self.curves.peak
        return FilmScales(self.free, peak, self.top, float(stored(peak) - stored(0)))

    @property
    def free(self) -> float:
        """mm, free length of the film."""
        return self.curves.film.outer - self.curves.film.inner

    @cached_property
    def _kernel(self) -> Any:
        fault = self.flaws.get("viscoelastic")
        if fault is None or fault.form == "flow":
            return None
        return loss_laws.relaxation_kernel(fault, self.course.time / self.course.lasts)

    def with_sizes(self, sizes: Mapping[str, float]) -> LiftingRig:
        """The same rig, some of its faults of other sizes."""
        other = replace(self, flaws={k: replace(f, size=sizes.get(k, f.size)) for k, f in self.flaws.items()})
        other.__dict__["_kernel"] = self._kernel  # costly, and knows no size
        other.__dict__["_scales"] = self._scales
        return other

    def si(self, name: str) -> float:
        """Size of a fault: m, N or a number; of a frame it is what it yields at the sound film's largest force."""
        units = {DEFLECTION: 1e-3 * self.curves.peak, FORCE: self.top, LENGTH: 1e-3 * self.free}
        return self.flaws[name].size * units.get(FAULTS[name].unit, 1.0)

    def reading(self, parameters: Sequence[float] | None = None) -> Any:
        """(N,) N without noise; with other parameters of the energy. Raises `NoBalanceError`."""
        return self._sensed(self._settled(parameters)[1] / self.top) * self.top

    def deflection(self) -> Any:
        """(N,) mm of the film itself."""
        return self._settled(None)[0]

    def _curve(self, parameters: Sequence[float] | None) -> CubicSpline:
        p = tuple(parameters or self.curves.rubber.parameters)
        fault = self.flaws.get("prestretch")
        if fault is None or fault.size == 0:
            return self.curves.curve(p)
        if fault.form == "even":
            return self.curves.curve(p, 1 + fault.size)
        return self.curves.curve(p, 1.0, -self.free * fault.size / (1 + fault.size))

    def _settled(self, parameters: Sequence[float] | None) -> tuple[Any, Any]:
        """(deflection of the film mm, its force N), with the frame in balance."""
        curve, at = self._curve(parameters), self._hook()
        fault = self.flaws.get("machine_compliance")
        x = np.maximum(at, 0)
        if fault is None or fault.size == 0:
            return x, self._film(curve, x)
        yields = fault.size * self.curves.peak
        for _ in range(TURNS):
            force = self._film(curve, x)
            part = force / self.top
            slope = (cell_laws.yielding(fault, part + 1e-4) - cell_laws.yielding(fault, part)) / 1e-4
            stiff = yields * slope * abs(curve(x, 1)) / self.top
            step = (np.maximum(at - yields * cell_laws.yielding(fault, part), 0) - x) / (1 + stiff)
            x = np.maximum(x + step, 0)
            if abs(step).max() < SETTLED * self.curves.peak:
                break
        if abs(step).max() > ACCEPTED * self.curves.peak:
            raise NoBalanceError("the frame does not come to rest")
        return x, self._film(curve, x)

    def _hook(self) -> Any:
        """(N,) mm, where the film would be lifted to if the frame were rigid."""
        at, peak = self.course.at, self.curves.peak
        if (fault := self.flaws.get("screw_ripple")) is not None:
            at = cell_laws.rippled(fault, at, peak)
        if (fault := self.flaws.get("lost_motion")) is not None:
            at = cell_laws.lost_motion(fault, at, peak)
        if (fault := self.flaws.get("zero_offset")) is not None:
            at = cell_laws.hooked(fault, at, peak)
        return at

    def _film(self, curve: CubicSpline, x: Any) -> Any:
        """(N,) N of the film on its path x (N,) mm."""
        load = CarriedLoad(self.course, x, curve, self._scales)
        shifted = x
        if (fault := self.flaws.get("permanent_set")) is not None and fault.form == "flow":
            shifted = np.maximum(x - film_laws.set_by_flow(fault, load), 0)
        if (fault := self.flaws.get("clamp_slip")) is not None:
            out = fault.size * self.free * film_laws.slipped(fault, load)
            force = LengthenedCone(curve, self.free).force(shifted, out)
        else:
            force = curve(shifted)
        if (fault := self.flaws.get("mullins")) is not None:
            force = force * film_laws.softened(fault, load)
        if (fault := self.flaws.get("permanent_set")) is not None and fault.form == "residual":
            force = force - film_laws.residual_force(fault, load)
        if (fault := self.flaws.get("hysteresis")) is not None:
            force = force + loss_laws.inner_friction(fault, load)
        force = np.maximum(force, 0)
        if (fault := self.flaws.get("tearing")) is not None:
            force = force * film_laws.torn(fault, load)
        if (fault := self.flaws.get("viscoelastic")) is not None:
            force = loss_laws.relaxed(fault, self._kernel, force, load)
        return force

    def _sensed(self, part: Any) -> Any:
        """(N,) F/top that the load cell tells."""
        clock = self.course.time / self.course.lasts
        if (fault := self.flaws.get("friction")) is not None:
            part = part + cell_laws.rubbing(fault, self.course, part)
        if (fault := self.flaws.get("force_offset")) is not None:
            part = part + fault.size
        if (fault := self.flaws.get("force_drift")) is not None:
            part = part + cell_laws.drifted(fault, clock)
        if (fault := self.flaws.get("zero_jump")) is not None:
            part = part + cell_laws.jumped(fault, clock)
        if (fault := self.flaws.get("draught")) is not None:
            part = part + cell_laws.draughty(fault, clock)
        if (fault := self.flaws.get("overload")) is not None:
            part = cell_laws.stopped_short(fault, part)
        return part
