"""What a calibration claims: one material, some effects, one noise model; its coordinates as one named vector."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array, Natural, Parameter
from bayesmembrane.ground.registry import component, material
from bayesmembrane.physics.convexity import REACHED, ConvexityMode, mode
from bayesmembrane.physics.effects.base import Compliance, Effect
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.noise.base import Noise, force_scale
from bayesmembrane.physics.noise.white import White
from bayesmembrane.physics.reach import reach_of

FRAME = "machine_compliance"
"""The effect that a blank run measures."""


@dataclass(frozen=True)
class Hypothesis:
    """y = F(delta; material, effects) + noise, with priors on all parameters and a convexity prior on the energy.

    material : class of the strain energy
    effects : what the plain film on an ideal rig lacks; their parameters join the vector
    noise : noise model
    convexity : where the prior asks the energy to be convex

    The vector x holds the material's coordinates, those of the effects, and those of the noise, in this order. Their
    names carry the component: ``yeoh.ln_gd``, ``clamp_slip.length``, ``noise.ln_sd``. Raises `SettingsError` for
    an effect that is named twice. A noise that infers something about effects suits itself to those that there are.
    """

    material: type[Material]
    effects: tuple[Effect, ...] = ()
    noise: Noise = field(default_factory=White)
    convexity: ConvexityMode = REACHED

    def __post_init__(self) -> None:
        names = [e.name for e in self.effects]
        if repeated := sorted({n for n in names if names.count(n) > 1}):
            raise SettingsError(f'the effect "{repeated[0]}" is named twice', remedy="name every effect once")
        object.__setattr__(self, "noise", self.noise.beside(self.effects))

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The coordinates x (k,) with priors and bounds, under their full names."""
        blocks = [(self.material.name, self.material.coordinates)]
        blocks += [(e.name, e.coordinates) for e in self.effects]
        blocks += [("noise", self.noise.coordinates)]
        return tuple(replace(p, name=f"{block}.{p.name}") for block, ps in blocks for p in ps)

    def on(self, measurement: Measurement) -> Self:
        """The same with the priors of its effects in parts of what the measurement reached, or as a blank run shows."""
        if not self.effects:
            return self
        reach = reach_of(measurement)
        effects = tuple((e if e.reach == reach else e.on(reach)).shown_by(measurement) for e in self.effects)
        return self if effects == self.effects else replace(self, effects=effects)

    def with_frame(self, measurement: Measurement) -> Self:
        """`on` it, with the frame that its blank run shows, if there is one: what is known is not in question."""
        if measurement.blank_run is None or any(isinstance(e, Compliance) for e in self.effects):
            return self.on(measurement)
        return replace(self, effects=(*self.effects, component("effects", FRAME)())).on(measurement)

    @property
    def in_question(self) -> tuple[Effect, ...]:
        """The effects that no other run of the rig has measured."""
        return tuple(e for e in self.effects if not e.known)

    @property
    def known_coordinates(self) -> frozenset[str]:
        """Full names of the coordinates of what another run of the rig has measured."""
        return frozenset(f"{e.name}.{p.name}" for e in self.effects if e.known for p in e.coordinates)

    @property
    def held(self) -> Self:
        """The same with what is known of the rig at its value, without coordinates; itself if nothing is."""
        effects = tuple(e.as_held() for e in self.effects)
        return self if effects == self.effects else replace(self, effects=effects)

    @property
    def names(self) -> tuple[str, ...]:
        """Full names of the k coordinates."""
        return tuple(p.name for p in self.parameters)

    @cached_property
    def natural_parameters(self) -> tuple[Natural, ...]:
        """What users read, under full names: membrane parameters (``yeoh.c1``), effects, noise (``noise.sd``)."""
        blocks = [(self.material.name, self.material.natural_parameters())]
        blocks += [(e.name, tuple(Natural(p.name, p.unit, p.meaning) for p in e.coordinates)) for e in self.effects]
        blocks += [("noise", self.noise.natural_parameters)]
        return tuple(replace(p, name=f"{block}.{p.name}") for block, ps in blocks for p in ps)

    @property
    def natural_names(self) -> tuple[str, ...]:
        """Full names of the natural parameters."""
        return tuple(p.name for p in self.natural_parameters)

    @property
    def natural_units(self) -> tuple[str, ...]:
        """Units of the natural parameters."""
        return tuple(p.unit for p in self.natural_parameters)

    @property
    def material_size(self) -> int:
        """How many coordinates the material has; they come first."""
        return len(self.material.coordinates)

    @property
    def curve_size(self) -> int:
        """How many coordinates shape the curve: all but those of the noise, which come last."""
        return len(self.parameters) - len(self.noise.coordinates)

    def films(self, x: ArrayLike) -> Array:
        """Membrane parameters (B, n) of coordinates x (B, k); k may leave out what comes after the material."""
        x = np.atleast_2d(np.asarray(x, dtype=float))
        with np.errstate(all="ignore"):
            return np.ascontiguousarray(self.material.from_coordinates(x[:, : self.material_size].T).T)

    def noise_coordinates(self, x: Array) -> Array:
        """The noise's part (B, m) of coordinates x (B, k)."""
        return x[:, self.curve_size :]

    def natural(self, x: ArrayLike, measurement: Measurement) -> Array:
        """Natural parameters (B, m), in the order of `natural_names`, of coordinates x (B, k)."""
        x = np.atleast_2d(np.asarray(x, dtype=float))
        noise = self.noise.natural(self.noise_coordinates(x), force_scale(measurement))
        return np.concatenate([self.films(x), x[:, self.material_size : self.curve_size], noise], axis=1)

    def label(self) -> str:
        """Material and effects in one word, for tables and folders: ``yeoh``, ``yeoh+zero_offset``."""
        return "+".join([self.material.name, *(e.name for e in self.effects)])

    def settings(self) -> dict[str, Any]:
        """What `from_settings` reads back; plain values, as a run stores them."""
        return {
            "material": self.material.name,
            "effects": [e.name for e in self.effects],
            "noise": self.noise.name,
            "extra_noise": self.noise.inferred,
            "convexity": self.convexity.name,
        }


def hypothesis(
    material_name: str,
    effects: Iterable[str] = (),
    noise: str = "white",
    convexity: str = REACHED.name,
    extra_noise: bool = True,
) -> Hypothesis:
    """The hypothesis made of components by name; raises `SettingsError` for a name that nobody declared.

    ``extra_noise`` False keeps to the noise that the measurement states, where the noise model can do without its own.
    """
    model = component("noise", noise)
    instance = model() if extra_noise else model.stated_only()
    return Hypothesis(
        material(material_name), tuple(component("effects", e)() for e in effects), instance, mode(convexity)
    )


def from_settings(settings: Mapping[str, Any]) -> Hypothesis:
    """The inverse of `Hypothesis.settings`; raises `SettingsError` for a name that nobody declares (any more)."""
    return hypothesis(
        settings["material"], settings["effects"], settings["noise"], settings["convexity"], settings["extra_noise"]
    )
