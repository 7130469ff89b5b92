"""Where the prior asks the energy to be convex in the stretches, and how strongly: four modes.

A mode reads margins from states that a solver met, or from the energy itself, and says which margins satisfy it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.errors import unknown_name
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics.convexity import box_margins
from bayesmembrane.physics.mechanics.request import Spared


class States(Protocol):
    """What is known of B films: parameters (B, n), margins over all states (B,), and state by state (B, M)."""

    @property
    def films(self) -> Array: ...
    @property
    def convexity(self) -> Array: ...
    @property
    def ellipticity(self) -> Array: ...
    @property
    def convexity_at(self) -> Array: ...
    @property
    def ellipticity_at(self) -> Array: ...


@dataclass(frozen=True)
class ConvexityMode(ABC):
    """One strength of the convexity prior.

    name : how users and stored files call it
    words : what it asks, after "convex"
    spare : films on which a solver need not spend effort once it knows that they miss the mode
    looks_beyond : whether it asks for states up to the end of the whole measured range
    restricts : False if every film satisfies it
    """

    name: ClassVar[str]
    words: ClassVar[str]
    spare: ClassVar[Spared] = Spared.NONE
    looks_beyond: ClassVar[bool] = False
    restricts: ClassVar[bool] = True

    def margin(self, states: States, material: type[Material]) -> Array:
        """(B,) by how much the mode is met. A film without any state counts as inside: its likelihood tells."""
        values = self._margin(states, material)
        return np.where(np.isnan(values), np.inf, values)

    @property
    def weaker(self) -> ConvexityMode | None:
        """The mode that asks for less; None if this one asks nothing.

        What has lost ellipticity folds, and costs most to follow: nobody who asks for more than that asks for it.
        """
        return ELLIPTIC if self.restricts else None

    @abstractmethod
    def _margin(self, states: States, material: type[Material]) -> Array:
        """(B,) with nan for a film without any state."""

    def margins_at(self, states: States, material: type[Material]) -> Array:
        """(B, M) margins state by state, for those who follow a constraint; nan where there is no state."""
        return self._margin(states, material)[:, None]

    def holds(self, margin: Array | float) -> NDArray[np.bool_]:
        """True where a margin satisfies the mode, of any shape."""
        return np.asarray(np.asarray(margin) >= 0)

    def met(self, states: States, material: type[Material]) -> NDArray[np.bool_]:
        """(B,) whether the mode `holds`."""
        return self.holds(self.margin(states, material))

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Reached(ConvexityMode):
    """The Hessian of W is positive semidefinite in all states that the film reaches over the whole measured range."""

    name = "reached"
    words = "on the states reached"
    spare = Spared.NOT_CONVEX
    looks_beyond = True

    def _margin(self, states: States, material: type[Material]) -> Array:
        return states.convexity

    def margins_at(self, states: States, material: type[Material]) -> Array:
        return states.convexity_at


@dataclass(frozen=True)
class Box(ConvexityMode):
    """The Hessian of W is positive semidefinite on [low, high]^2."""

    low: float = 1.0
    high: float = 8.0

    name = "box"
    words = "on the box of stretches"

    def met(self, states: States, material: type[Material]) -> NDArray[np.bool_]:
        """(B,) whether the mode `holds`; the box of an energy that is convex everywhere is not searched."""
        found = np.array(material.convex_everywhere(states.films.T), dtype=bool)
        margin = box_margins(material, states.films[~found], self.low, self.high, sign_only=True)
        found[~found] = np.isnan(margin) | self.holds(margin)
        return found

    def _margin(self, states: States, material: type[Material]) -> Array:
        return box_margins(material, states.films, self.low, self.high)


@dataclass(frozen=True)
class Elliptic(ConvexityMode):
    """P11 > 0 and P22 > 0 in all states that the film reaches over the whole measured range."""

    name = "elliptic"
    words = "in each direction alone (P11, P22 > 0) on the states reached"
    spare = Spared.NOT_ELLIPTIC
    looks_beyond = True

    def _margin(self, states: States, material: type[Material]) -> Array:
        return states.ellipticity

    def margins_at(self, states: States, material: type[Material]) -> Array:
        return states.ellipticity_at

    @property
    def weaker(self) -> ConvexityMode | None:
        return FREE

    def holds(self, margin: Array | float) -> NDArray[np.bool_]:
        return np.asarray(np.asarray(margin) > 0)


@dataclass(frozen=True)
class Free(ConvexityMode):
    """Nothing is asked."""

    name = "none"
    words = "nowhere"
    restricts = False

    def _margin(self, states: States, material: type[Material]) -> Array:
        return np.full(len(states.films), np.inf)


REACHED, BOX, ELLIPTIC, FREE = Reached(), Box(), Elliptic(), Free()
MODES: dict[str, ConvexityMode] = {m.name: m for m in (REACHED, BOX, ELLIPTIC, FREE)}
RESTRICTING = tuple(m for m in MODES.values() if m.restricts)
"""The modes that exclude films, the strongest claim about the measurement first."""


def mode(name: str) -> ConvexityMode:
    """The mode called ``name``; raises `SettingsError` with the nearest known names."""
    if name not in MODES:
        raise unknown_name("convexity prior", name, MODES)
    return MODES[name]
