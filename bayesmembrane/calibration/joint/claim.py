"""What a joint calibration claims: one energy in several tests, each with its own film, effects and noise."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.fingerprint import digest
from bayesmembrane.ground.parameters import Array, Natural, Parameter
from bayesmembrane.physics.convexity import ConvexityMode
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.materials.base import Material

WALK = "walk"
"""The folder of the walk among those of the tests."""
LONG = 20
"""Letters; a longer label spreads over lines in a table."""
_LABEL = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,39}")


@dataclass(frozen=True, eq=False)
class JointTest:
    """One of the tests.

    label : a word, by which its own parameters are called: ``strip.zero_offset.shift``
    measurement : what was measured
    hypothesis : what is claimed of it
    """

    label: str
    measurement: Measurement
    hypothesis: Hypothesis

    def __post_init__(self) -> None:
        if not _LABEL.fullmatch(self.label) or self.label == WALK:
            raise SettingsError(
                f'a test cannot be called "{self.label}"',
                remedy=f"use letters, digits, - and _, as in strip-1, and not {WALK}",
            )
        object.__setattr__(self, "hypothesis", self.hypothesis.with_frame(self.measurement))


@dataclass(frozen=True, eq=False)
class Joint:
    """y_m = F_m(x) + noise_m for tests m of one material.

    The vector x (K,) holds the coordinates of the material, which all tests share, and then test by test those of its
    effects and those of its noise. The energy is that of the thinnest film, so that the order of the tests does not
    matter; a film d times as thick has d times its membrane parameters, which adds ln d to the first coordinate.

    Raises `SettingsError` for no test, for two of one label or of the same readings, which would count twice, and for
    tests of different energies or convexity priors.
    """

    parts: tuple[JointTest, ...]

    def __post_init__(self) -> None:
        if not self.parts:
            raise SettingsError("there is no measurement to calibrate on", remedy="give one at least")
        labels = self.labels
        if twice := sorted({label for label in labels if labels.count(label) > 1}):
            raise SettingsError(f'two tests are called "{twice[0]}"', remedy="give each its own name")
        self._no_reading_twice()
        for part in self.parts:
            h = part.hypothesis
            if h.material is not self.material or h.convexity != self.convexity:
                raise SettingsError(
                    "a joint calibration has one energy and one convexity prior",
                    f'test "{part.label}"',
                    f"use {self.material.name} and {self.convexity} there, too",
                )

    def _no_reading_twice(self) -> None:
        first: dict[str, str] = {}
        for part in self.parts:
            if (label := first.setdefault(part.measurement.data_hash, part.label)) != part.label:
                raise SettingsError(
                    f'the tests "{label}" and "{part.label}" hold the same readings, which would count twice',
                    remedy="leave one of them out",
                )

    @property
    def held(self) -> Joint:
        """The same with what is known of each rig at its value, without coordinates."""
        return replace(self, parts=tuple(replace(p, hypothesis=p.hypothesis.held) for p in self.parts))

    @property
    def labels(self) -> tuple[str, ...]:
        """What the tests are called."""
        return tuple(part.label for part in self.parts)

    @property
    def material(self) -> type[Material]:
        """The energy that all tests share."""
        return self.parts[0].hypothesis.material

    @property
    def convexity(self) -> ConvexityMode:
        """Where the prior asks it to be convex: on the states of every test."""
        return self.parts[0].hypothesis.convexity

    @property
    def thickness(self) -> float:
        """m, of the thinnest film: the one whose membrane parameters are meant."""
        return min(part.measurement.specimen.thickness for part in self.parts)

    @property
    def shared(self) -> int:
        """How many coordinates the tests share; they come first."""
        return len(self.material.coordinates)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The coordinates x (K,) with priors and bounds, under their full names."""
        found = list(self.parts[0].hypothesis.parameters[: self.shared])
        for part in self.parts:
            own = part.hypothesis.parameters[self.shared :]
            found += [replace(p, name=f"{part.label}.{p.name}") for p in own]
        return tuple(found)

    @property
    def names(self) -> tuple[str, ...]:
        """Full names of the K coordinates."""
        return tuple(p.name for p in self.parameters)

    @cached_property
    def places(self) -> tuple[NDArray[np.intp], ...]:
        """Where the coordinates of each test, those of its `Hypothesis`, stand in x."""
        found, begin = [], self.shared
        for part in self.parts:
            own = len(part.hypothesis.parameters) - self.shared
            found.append(np.concatenate([np.arange(self.shared), begin + np.arange(own)]))
            begin += own
        return tuple(found)

    @cached_property
    def curve(self) -> NDArray[np.intp]:
        """Where those coordinates stand in x that shape a curve: all but the noise."""
        sizes = [part.hypothesis.curve_size for part in self.parts]
        return np.unique(np.concatenate([at[:n] for at, n in zip(self.places, sizes, strict=True)]))

    def thicker(self, number: int) -> float:
        """Thickness of the film of a test over that of the thinnest."""
        return self.parts[number].measurement.specimen.thickness / self.thickness

    def of(self, number: int, x: ArrayLike) -> Array:
        """Coordinates (..., k) of one test in its own film, from x (..., K)."""
        own = np.asarray(x, dtype=float)[..., self.places[number]]
        own[..., 0] += np.log(self.thicker(number))
        return own

    def films(self, x: ArrayLike) -> Array:
        """Membrane parameters (B, n) of the thinnest film."""
        return self.parts[0].hypothesis.films(np.atleast_2d(np.asarray(x, dtype=float))[:, : self.shared])

    @cached_property
    def natural_parameters(self) -> tuple[Natural, ...]:
        """What users read: membrane parameters of the thinnest film, then effects and noise of every test."""
        n = len(self.material.natural_parameters())
        found = list(self.parts[0].hypothesis.natural_parameters[:n])
        for part in self.parts:
            own = part.hypothesis.natural_parameters[n:]
            found += [replace(p, name=f"{part.label}.{p.name}") for p in own]
        return tuple(found)

    @property
    def natural_names(self) -> tuple[str, ...]:
        """Full names of the natural parameters."""
        return tuple(p.name for p in self.natural_parameters)

    def natural(self, x: ArrayLike) -> Array:
        """Natural parameters (B, m) of x (B, K), in the order of `natural_names`."""
        x = np.atleast_2d(np.asarray(x, dtype=float))
        found, n = [self.films(x)], len(self.material.natural_parameters())
        for i, part in enumerate(self.parts):
            found.append(part.hypothesis.natural(self.of(i, x), part.measurement)[:, n:])
        return np.concatenate(found, axis=1)

    def label(self) -> str:
        """Material, and the effects of any test, in one word."""
        effects = dict.fromkeys(e.name for part in self.parts for e in part.hypothesis.effects)
        return "+".join([self.material.name, *effects])

    @property
    def data_hash(self) -> str:
        """SHA-256 of all that the likelihood depends on, test by test."""
        return digest({part.label: part.measurement.data_hash for part in self.parts})

    def settings(self) -> dict[str, Any]:
        """Plain values: what is claimed of each test."""
        return {part.label: part.hypothesis.settings() for part in self.parts}


def joint(
    measurements: Mapping[str, Measurement] | Sequence[Measurement], hypothesis: Hypothesis | Mapping[str, Hypothesis]
) -> Joint:
    """Tests by label, or in an order, and one claim for all or one for each label.

    Without labels tests are called after their specimens. Raises what `JointTest` and `Joint` raise, and
    `SettingsError` for a claim that is missing or belongs to no test.
    """
    each: list[object] = list(measurements.values() if isinstance(measurements, Mapping) else measurements)
    if odd := [m for m in each if not isinstance(m, Measurement)]:
        raise SettingsError(f"{odd[0]!r:.40} is no measurement", remedy="read it first, by read or read_measurement")
    named = measurements if isinstance(measurements, Mapping) else _named(measurements)
    if isinstance(hypothesis, Mapping):
        if alone := sorted(set(hypothesis) ^ set(named)):
            raise SettingsError(
                f'"{alone[0]}" is not both among the measurements and among the hypotheses',
                remedy="name each test in both",
            )
        claims = dict(hypothesis)
    else:
        claims = dict.fromkeys(named, hypothesis)
    return Joint(tuple(JointTest(label, m, claims[label]) for label, m in named.items()))


def _named(measurements: Sequence[Measurement]) -> dict[str, Measurement]:
    """Tests by the names of their specimens."""
    return dict(zip(labelled([("", m) for m in measurements]), measurements, strict=True))


def labelled(tests: Sequence[tuple[str, Measurement]]) -> list[str]:
    """Labels of tests (label or "", measurement): their own, else made of their specimens' names, or of their files'
    where these are shorter and a name is too long to be read in a table; numbered if alike.
    """
    found: list[str] = []
    for own, m in tests:
        stem = own or called(m.specimen.name)
        if not own and len(stem) > LONG and m.provenance.curve:
            stem = min(stem, called(Path(m.provenance.curve).stem), key=len)
        label, number = stem, 2
        while label in found and not own:
            label, number = f"{stem}-{number}", number + 1
        found.append(label)
    return found


def called(name: str) -> str:
    """A label made of any name: "Film 1" -> "film-1"."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower())[:30].strip("-") or "test"
