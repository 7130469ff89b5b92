"""A fingerprint of everything that an answer depends on: the code it reaches, priors, data, settings and seed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.fingerprint import digest, majors, reached
from bayesmembrane.physics.hypothesis import Hypothesis

SAMPLING = ("bayesmembrane.calibration.sampling.walk", "bayesmembrane.calibration.outcome")
"""What makes the draws of a run, and what makes the numbers and arrays that are stored with them."""


def fingerprint(
    entries: str | Iterable[str],
    hypotheses: Hypothesis | Iterable[Hypothesis],
    measurements: Measurement | Iterable[Measurement],
    settings: Mapping[str, Any],
    seed: int,
    also: Iterable[type[Any]] = (),
) -> str:
    """SHA-256 over the code that ``entries`` reach, and over hypotheses, data, plain ``settings`` and ``seed``.

    ``entries`` are dotted names of the modules whose functions make the answer; ``also`` are materials and effects that
    it may try besides those of the hypotheses: all of them, where it seeks what is missing. Equal fingerprints mean
    equal answers; a comment, a new component or a sentence elsewhere changes nothing. See `code_of` for what counts as
    code.
    """
    claims = (hypotheses,) if isinstance(hypotheses, Hypothesis) else tuple(hypotheses)
    data = (measurements,) if isinstance(measurements, Measurement) else tuple(measurements)
    return digest(
        {
            "code": code_of(entries, claims, data, also),
            "hypotheses": [h.settings() for h in claims],
            "data": [m.data_hash for m in data],
            "settings": dict(settings),
            "seed": seed,
        }
    )


def code_of(
    entries: str | Iterable[str],
    hypotheses: Iterable[Hypothesis],
    measurements: Iterable[Measurement],
    also: Iterable[type[Any]] = (),
) -> str:
    """SHA-256 of what the modules ``entries`` reach for these hypotheses on these measurements.

    That is the statements of the modules that they import, of the own material, effects, noise and rig, of materials
    and effects in ``also``, and of what these import; every prior and its bounds as values; and the major versions of
    the packages that do the numerical work.
    """
    claims, further = tuple(hypotheses), sorted(set(also), key=_place)
    names = (entries,) if isinstance(entries, str) else tuple(entries)
    components = set(further) | {part for h in claims for part in _components(h)} | {type(m.rig) for m in measurements}
    priors = [[p.name, repr(p.prior), repr(p.bounds)] for h in claims for p in h.parameters]
    priors += [[f"{c.name}.{p.name}", repr(p.prior), repr(p.bounds)] for c in further for p in c.coordinates]
    return digest(
        {
            "modules": reached(names, sorted(components, key=_place)),
            "priors": priors,
            "majors": majors(),
        }
    )


def _place(component: type[Any]) -> tuple[str, str]:
    """Where a class stands."""
    return component.__module__, component.__qualname__


def _components(hypothesis: Hypothesis) -> Iterator[type[Any]]:
    yield hypothesis.material
    yield from (type(effect) for effect in hypothesis.effects)
    yield type(hypothesis.noise)
