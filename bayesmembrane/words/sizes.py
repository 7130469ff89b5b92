"""How large an effect is, in words, flagged where it stands: far beyond what is usual, or at a bound."""

from __future__ import annotations

from collections.abc import Iterable

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.standard import expected_size
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.effects.base import AT, Effect, EffectParameter
from bayesmembrane.words.language import spoken_parameter
from bayesmembrane.words.units import SCALES, Units, size_in_words

LEAST = 1e-4
"""Times the usual size, below which a number would only say that a search ended there."""
IMPLAUSIBLE = 5.0
"""Times the usual size, from which on a size is flagged."""


def units_of(names: Iterable[str]) -> dict[str, str]:
    """SI unit of each parameter of an effect: ``machine_compliance.compliance``, ``mullins@strip.softening``."""
    return {name: _declared(name).unit for name in names}


def parameter_in_words(name: str, value: float, shown: Units = SCALES) -> str:
    """``stretch 1.0123``: a parameter of an effect in SI, in the unit that people read."""
    p = _declared(name)
    return f"{p.name} {size_in_words(value, p.unit, shown, p.null)}"


def _declared(name: str) -> EffectParameter:
    effect, _, own = name.partition(".")
    declared: tuple[EffectParameter, ...] = components("effects")[effect.partition(AT)[0]].coordinates
    return next(p for p in declared if p.name == own)


def usual_size(effect: Effect, measurement: Measurement, shown: Units = SCALES) -> str:
    """What is usual before the data, for a test that reached what this one did."""
    return size_in_words(expected_size(effect, measurement), effect.size.unit, shown)


def times_usual(effect: Effect, candidate: Candidate, measurement: Measurement) -> float:
    """The size of one of its effects over what is usual before the data."""
    p = effect.size
    value = candidate.parameters[f"{effect.name}.{p.name}"]
    return abs(value - (p.null or 0.0)) / expected_size(effect, measurement)


def hardly_met(candidate: Candidate, measurement: Measurement) -> bool:
    """Whether one of its effects is of a size that is flagged as implausible."""
    return any(times_usual(e, candidate, measurement) >= IMPLAUSIBLE for e in candidate.hypothesis.effects)


def flagged_size(effect: Effect, candidate: Candidate, measurement: Measurement) -> str:
    """``loss 0.66, implausible: usual 0.1``: the size of one of its effects, with what must be known of it."""
    shown = measurement.rig.shown(measurement.specimen.thickness)
    p, name = effect.size, spoken_parameter(f"{effect.name}.{effect.size.name}")
    value, times = candidate.parameters[f"{effect.name}.{p.name}"], times_usual(effect, candidate, measurement)
    if times < LEAST:
        return f"{name} too small to show"
    assumed = " at an assumed 1 mm/s" if measurement.time is None and p.unit.endswith("/s") else ""  # `NOMINAL_SPEED`
    told = [f"{name} {size_in_words(value, p.unit, shown, p.null)}{assumed}"]
    if times >= IMPLAUSIBLE:
        told.append(f"implausible: usual {usual_size(effect, measurement, shown)}")
    own = [n.partition(".")[2] for n in candidate.at_bound if n.startswith(f"{effect.name}.")]
    told += [("" if n == p.name else f"{n.replace('_', ' ')} ") + "at its bound" for n in own]
    return ", ".join(told)


def bound_of_material(candidate: Candidate) -> str:
    """``, c2/c1 at its bound`` of the energy's own parameters; "" where none is."""
    effects = {e.name for e in candidate.hypothesis.effects}
    own = [spoken_parameter(n) for n in candidate.at_bound if n.partition(".")[0] not in effects]
    return f"{', '.join(own)} at {'its bound' if len(own) == 1 else 'their bounds'}" if own else ""
