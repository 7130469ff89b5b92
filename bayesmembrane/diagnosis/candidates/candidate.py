"""What could explain the curve: a material with some effects at its most probable parameters."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.speeds import one_speed
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.effects.base import Effect
from bayesmembrane.physics.form_error import error_size
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.reach import reach_of


@dataclass(frozen=True, eq=False)
class Candidate:
    """One hypothesis at its most probable parameters, under the measurement's own noise and its form error.

    hypothesis : material and effects
    x : (k,) coordinates
    residual : (N,) N, measured less fitted
    slopes : (N, k) dF/dx there
    log_evidence : ln Z, up to a constant that all candidates share
    at_bound : names of coordinates at a bound
    traces : (E, N) N, what each effect changes of the force; zeros for one that has no law that could be off
    theta : (h,) ln of noise over its reference, ln of the relative error of the energy and of every law
    form : (N,) N, of the residual what the form error carries; the rest is noise
    by_draws : of ln Z what draws brought beyond its linear model, where they were asked
    """

    hypothesis: Hypothesis
    x: Array
    residual: Array
    slopes: Array
    log_evidence: float
    at_bound: tuple[str, ...]
    traces: Array
    theta: Array
    form: Array
    by_draws: float = 0.0

    def check_restored(self) -> None:
        """Raise `ValueError` if its effects had other parameters when it was stored."""
        size = self.hypothesis.curve_size
        if self.x.size != size:
            raise ValueError(f"{self.label} has {size} parameters, and {self.x.size} are stored")

    @property
    def names(self) -> tuple[str, ...]:
        """Its effects."""
        return tuple(e.name for e in self.hypothesis.effects)

    @property
    def label(self) -> str:
        """Material, effects and noise by name: of the candidates of one measurement, each has its own."""
        return self.hypothesis.label()

    @property
    def energy_error(self) -> float:
        """eta_a, the relative error of the energy's form."""
        return float(np.exp(self.theta[1]))

    @property
    def law_errors(self) -> dict[str, float]:
        """{effect: eta_e, the relative error of its law, or change of its size}, of those that could be off."""
        own = [e.name for e in self.hypothesis.effects if error_size(e) is not None]
        return {name: float(np.exp(t)) for name, t in zip(own, self.theta[2:], strict=False)}

    def law_errors_beyond(self, given: Collection[str]) -> dict[str, float]:
        """The same of the effects that are in question, not of those ``given``."""
        return {name: error for name, error in self.law_errors.items() if name not in given}

    def at(self, keep: NDArray[np.bool_]) -> Candidate:
        """The same, of the readings ``keep`` (N,) alone."""
        return replace(
            self,
            residual=self.residual[keep],
            slopes=self.slopes[keep],
            traces=self.traces[:, keep],
            form=self.form[keep],
        )

    def slopes_of(self, names: Collection[str]) -> Array:
        """(N, m) the slopes of the coordinates of these effects."""
        sizes = [len(e.coordinates) for e in self.hypothesis.effects]
        owner = np.repeat(self.names, sizes) if sizes else np.empty(0, dtype=str)
        start = self.hypothesis.material_size
        return self.slopes[:, start : start + owner.size][:, np.isin(owner, list(names))]

    @property
    def parameters(self) -> dict[str, float]:
        """Effect parameters by full name, SI."""
        n = self.hypothesis.material_size
        names = self.hypothesis.names[n : self.hypothesis.curve_size]
        return {name: float(v) for name, v in zip(names, self.x[n:], strict=True)}


def with_effects(hypothesis: Hypothesis, effects: Sequence[Effect]) -> Hypothesis:
    """The hypothesis with more effects."""
    return replace(hypothesis, effects=(*hypothesis.effects, *effects))


def without_effect(candidate: Candidate, name: str) -> tuple[Hypothesis, Array]:
    """The hypothesis of a candidate without one of its effects, and the coordinates of the rest where they are."""
    h = candidate.hypothesis
    owner = np.repeat(candidate.names, [len(e.coordinates) for e in h.effects])
    keep = np.ones(candidate.x.size, dtype=bool)
    keep[h.material_size : h.material_size + owner.size] = owner != name
    return replace(h, effects=tuple(e for e in h.effects if e.name != name)), candidate.x[keep]


def available(measurement: Measurement, hypothesis: Hypothesis) -> list[Effect]:
    """Effects of the library that can be seen in this test, can be told from the material, and are not there yet."""
    thin = measurement.specimen.thickness
    possible = [e for e in _possible(measurement, hypothesis) if not e.absorbed and not e.negligible(thin)]
    return [e for e in possible if _shows(e, measurement)]


def hidden(measurement: Measurement, hypothesis: Hypothesis) -> list[Effect]:
    """Effects that another energy takes for its own in this test, and that further tests of the material may show."""
    return [e for e in _possible(measurement, hypothesis) if e.absorbed or not _shows(e, measurement)]


def absorbed(measurement: Measurement, hypothesis: Hypothesis) -> list[Effect]:
    """Effects that the material absorbs without trace."""
    return [e for e in _possible(measurement, hypothesis) if e.absorbed]


def unsought(measurement: Measurement, hypothesis: Hypothesis) -> list[Effect]:
    """Effects that the test shows, if at all, as another energy would, since it only goes one way, or at one speed."""
    return [e for e in hidden(measurement, hypothesis) if not e.absorbed]


def _shows(effect: Effect, m: Measurement) -> bool:
    """True if the motion is such that it is no matter of the energy alone."""
    returns = bool(np.any(m.leg < 0))
    if effect.needs_speeds:
        return returns or not one_speed(m)
    return returns or not effect.needs_return or (m.has_pauses and effect.shows_at_rest)


def _possible(measurement: Measurement, hypothesis: Hypothesis) -> list[Effect]:
    """Effects of the library that can occur in this test and are not in the hypothesis."""
    reach = reach_of(measurement)
    found: list[Effect] = [cls(reach) for cls in components("effects").values()]
    have = {e.name for e in hypothesis.effects}
    rig, path = measurement.rig, measurement.path
    return [e for e in found if e.name not in have and not e.unavailable(rig, path)]
