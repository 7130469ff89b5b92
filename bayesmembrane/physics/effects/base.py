"""What an effect declares: its parameters, the stage at which it acts, and the one method of that stage.

Stages compose in this order, whatever the order in which effects are named:

    Geometry -> Deflection -> Slack -> Carried -> Memory -> Compliance -> Sensor

A slack film carries no force: where the deflection left for the film is not positive, `Carried` and what follows start
from zero. One with a pre-stretch is taut below its plane, too, and pulls back. `Compliance` closes a loop around all
stages from `Deflection` to `Memory`, for the frame yields to the force that the film has after them. Arrays are (B, N):
B draws, N points in the order of the test; ``p`` is (B, k), the effect's own parameters in the order of
``coordinates``.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import ClassVar, Self

import numpy as np

from bayesmembrane.data.fixture import Fixture
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array, Parameter, Prior
from bayesmembrane.physics.reach import Reach

AT = "@"
"""Between the name of an effect, or of what is foreign, and the label of the one test of several that it is in."""


@dataclass(frozen=True)
class EffectParameter(Parameter):
    """A parameter of an effect, in SI; priors and bounds of lengths, forces and their rates are those of `SOURCE`.

    null : the value at which the effect vanishes, exactly; None for a shape, which means nothing once it has vanished
    of_the_test : True of a time that is a part of the test's duration, and no time of the film or the rig
    begin : where searches begin, if not at the `typical` value
    event : "way" of where, in parts of the full range, and "clock" of when, in s, something comes that may be sudden
    """

    null: float | None = None
    of_the_test: bool = False
    begin: float | None = None
    event: str = ""

    def on(self, reach: Reach) -> Self:
        """The same where a test goes so far: what is a part of that grows with it."""
        factor = reach.times_as_long if self.of_the_test else reach.times(self.unit)
        low, high = self.bounds
        null, begin = (None if v is None else factor * v for v in (self.null, self.begin))
        return replace(
            self, prior=self.prior.times(factor), bounds=(factor * low, factor * high), null=null, begin=begin
        )

    @property
    def one_sided(self) -> bool:
        """True if physics allows one sign only: the null value is a bound."""
        return self.null is not None and self.null in self.bounds

    @property
    def sense(self) -> tuple[float, float]:
        """Between which values it means anything: of a size with a unit, the null value that is a bound, for how large
        it may be depends on the rig; else the bounds.
        """
        if self.null is None or self.unit == "-":
            return self.bounds
        low, high = self.bounds
        return (low if low == self.null else -math.inf), (high if high == self.null else math.inf)

    @property
    def scale(self) -> float:
        """Size that is expected before the data: the prior's root mean square distance from null, or its sd."""
        return _scale(self.prior, self.null)

    @property
    def typical(self) -> float:
        """Prior median of a shape; null value plus one scale of a size."""
        return float(self.prior.quantile(0.5)) if self.null is None else self.null + self.scale

    @property
    def first(self) -> float:
        """Where searches begin."""
        return self.typical if self.begin is None else self.begin


@cache
def _scale(prior: Prior, null: float | None) -> float:
    mean, sd = prior.mean_sd
    return sd if null is None else math.hypot(sd, mean - null)


@dataclass(frozen=True)
class Effect(ABC):
    """Something real that the plain film on an ideal rig lacks.

    A subclass derives from the class of its stage and declares

    name, title, reference : how users call it, how reports print it, where it comes from
    signature : what residual it leaves, in an engineer's words
    coordinates : its parameters; the first one is its size, and at its null value nothing changes, whatever the others
    needs_clamp : True if it only occurs on rigs that clamp the film all round
    needs_time : True if it means nothing without times
    needs_return : True if a test that only goes one way shows nothing of it that an energy could not: not sought there
    shows_at_rest : True if a hold shows it as well as a return does
    needs_speeds : True if a test that only goes one way at one speed shows nothing of it that an energy could not
    absorbed : "" or the sentence that says why the material absorbs it without trace; then nothing can name it
    exact : True if it has no law that could be off: an offset is an offset
    may_change : True of one that is exact, and whose size may all the same become another one while a test is made
    remembers : False if it changes the curve by a function of the deflection alone, alike on every leg, in its plainest
        shape
    scales_with_modulus : True if forces stay proportional to the modulus, which is relied on; False costs time only
    of_the_material : True if all tests of one material have it, or none of them
    constant : True if its parameters are then the same in all of them; those of others belong to what a test reached
    twins_at_one_speed : names of effects that only another speed, or a hold, tells from this one
    twins_at_any_speed : names of effects that only the shape of its law tells from this one, whatever the motion
    of_many_shapes : True if its law has so many shapes that only one far behind is told from its twins at any speed
    twins_one_way : names of effects that only the way back tells from this one
    begins : the coordinate that says when it comes, in s since the start; "" where it comes with the way
    second : (part, place, second place), the coordinates that say what part of what comes at once comes in a second
        event, and where the two are; None where there is only one
    like_foreign : kinds of what no effect describes (`diagnosis.explanation.foreign`) that leave what this one leaves:
        what comes at any moment is a fall of the force, what takes way from the film steps that a drive has lost
    odds : how often it is met beside the others, before anything is measured
    mistaken : how much is told of something else behind it, however sure the sum over hypotheses is of it beside other
        effects: it is a matter of many laws, of which the library has one. Less where hardly anything else leaves what
        it leaves: on 403 films by hands that knew nothing of this package such effects were there on 186 of 196 where
        they had 0.9 or more (0.01), zero and compliance on 23 of 28 (0.12), and all others on 82 of 127. The numbers
        are those with the best log score there; an effect without such a record has that of the last
    rank : orders effects within a stage; equal ranks go by name

    reach : of the test that it is at work in; None: that for which priors and bounds are declared
    """

    reach: Reach | None = None

    name: ClassVar[str]
    title: ClassVar[str]
    reference: ClassVar[str]
    signature: ClassVar[str]
    coordinates: ClassVar[tuple[EffectParameter, ...]]
    needs_clamp: ClassVar[bool] = False
    needs_time: ClassVar[bool] = False
    needs_return: ClassVar[bool] = False
    shows_at_rest: ClassVar[bool] = False
    needs_speeds: ClassVar[bool] = False
    absorbed: ClassVar[str] = ""
    exact: ClassVar[bool] = False
    may_change: ClassVar[bool] = False
    remembers: ClassVar[bool] = True
    scales_with_modulus: ClassVar[bool] = False
    of_the_material: ClassVar[bool] = False
    constant: ClassVar[bool] = False
    twins_at_one_speed: ClassVar[tuple[str, ...]] = ()
    twins_at_any_speed: ClassVar[tuple[str, ...]] = ()
    of_many_shapes: ClassVar[bool] = False
    twins_one_way: ClassVar[tuple[str, ...]] = ()
    like_foreign: ClassVar[tuple[str, ...]] = ()
    begins: ClassVar[str] = ""
    second: ClassVar[tuple[str, str, str] | None] = None
    odds: ClassVar[float] = 1.0
    mistaken: ClassVar[float] = 0.25
    rank: ClassVar[int] = 0
    stage: ClassVar[str]

    def __post_init__(self) -> None:
        if self.reach is not None:
            declared, reach = type(self).coordinates, self.reach
            object.__setattr__(self, "coordinates", tuple(p.on(reach) for p in declared))

    def on(self, reach: Reach) -> Self:
        """The same in a test that goes so far."""
        return replace(self, reach=reach)

    def shown_by(self, measurement: Measurement) -> Self:
        """The same with what another run of the rig says of it (`Measurement.blank_run`), and no other."""
        return self

    @property
    def known(self) -> bool:
        """True if another run of the rig has measured it: its size has a value with an error, and no null value."""
        return False

    def as_held(self) -> Self:
        """One that is `known`, without coordinates, as the other run has it; any other one as it is."""
        return self

    @property
    def null(self) -> Array:
        """(k,) parameters at which it vanishes, shapes where searches begin."""
        return np.array([p.first if p.null is None else p.null for p in self.coordinates])

    @property
    def typical(self) -> Array:
        """(k,) parameters of an effect of the size that is expected before the data."""
        return np.array([p.typical for p in self.coordinates])

    @property
    def size(self) -> EffectParameter:
        """The parameter whose null value switches it off."""
        return self.coordinates[0]

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers of the coordinates that switch it off together: of all but sets of effects the first alone."""
        return (0,)

    @property
    def starts(self) -> list[dict[str, float]]:
        """Shapes by name from which searches for it start, beside the typical ones."""
        return []

    def within(self, test: int) -> Effect | None:
        """The effect in one of several tests (their number); None if it is not at work there."""
        return self

    def come_at(self, moment: float) -> list[dict[str, float]]:
        """Shapes by name from which it is searched for where it is seen to come at a ``moment`` (s on the clock)."""
        return []

    @property
    def second_places(self) -> list[float]:
        """Where a second event is looked for, of which searches begin without: one is found from nearby only."""
        return []

    @classmethod
    def occurs_on(cls, rig: Fixture | type[Fixture]) -> bool:
        """True if it can occur on such a rig: states that are no stations of one path remember nothing."""
        return rig.has_path and (rig.clamped or not cls.needs_clamp)

    def unavailable(self, rig: Fixture, path: Motion) -> str:
        """Why it cannot occur on this rig and path, as a clause; "" if it can."""
        if not self.occurs_on(rig):
            return f'the effect "{self.name}" does not occur on the rig "{rig.name}"'
        if self.needs_time and path.time is None:
            return f'the effect "{self.name}" needs times, and the measurement has none'
        return ""

    def negligible(self, thickness: float) -> str:
        """Why it is too small to be looked for in a film of this thickness (m), as a clause; "" if it is not."""
        return ""

    def within_bounds(self, p: Array) -> Array:
        """Parameters (B, k), moved to the nearest bound of what means anything where they lie outside."""
        return np.clip(p, *self._sense)

    @cached_property
    def _sense(self) -> tuple[Array, Array]:
        """(k,) and (k,): between which parameters mean anything."""
        low, high = np.array([c.sense for c in self.coordinates]).reshape(-1, 2).T
        return low, high


@dataclass(frozen=True, eq=False)
class FilmState:
    """The film at all points of a path, before what it remembers acts on its force.

    path : the protocol
    deflection : (B, N) m, what is left for the film; one without a pre-stretch is slack where it is not positive
    force : (B, N) N, of a film without memory at this deflection; 0 where it is slack
    slope : (B, N) N/m, its derivative
    """

    path: Motion
    deflection: Array
    force: Array
    slope: Array

    @cached_property
    def reached(self) -> Array:
        """(B, N) m: largest deflection so far."""
        return running_max(self.deflection)


def running_max(values: Array) -> Array:
    """(B, N) max(0, largest so far) along the path."""
    return np.asarray(np.maximum.accumulate(np.maximum(values, 0.0), axis=-1))


class Geometry(Effect, ABC):
    """How the film was mounted."""

    stage = "geometry"
    scales_with_modulus = True

    @abstractmethod
    def prestretch(self, p: Array) -> Array:
        """(B,) factor on the equibiaxial pre-stretch; 1 changes nothing. May not lie below 1."""


class Deflection(Effect, ABC):
    """How much of the measured deflection the film gets."""

    stage = "deflection"
    scales_with_modulus = True

    @abstractmethod
    def deflect(self, p: Array, deflection: Array, path: Motion) -> Array:
        """(B, N) m: the deflection of the film, from that (B, N) before this effect."""

    def deflect_taut(self, p: Array, deflection: Array, path: Motion) -> Array:
        """The same of a film with a pre-stretch, which carries force on both sides of its plane."""
        return self.deflect(p, deflection, path)


class Slack(Effect, ABC):
    """Free length that the film gains while it is tested."""

    stage = "history-dependent geometry"
    scales_with_modulus = True

    @abstractmethod
    def excess(self, p: Array, deflection: Array, path: Motion) -> Array:
        """(B, N) gain in free length relative to the length at rest, 0 or more; contributions of effects add up."""


class Carried(Effect, ABC):
    """What the film carries of the force that it would carry without memory."""

    stage = "material and multiplicative history"

    @abstractmethod
    def carried(self, p: Array, force: Array, state: FilmState) -> Array:
        """(B, N) N: the force, from that (B, N) before this effect."""


class Memory(Effect, ABC):
    """How the force depends on time and speed."""

    stage = "time"

    @abstractmethod
    def remember(self, p: Array, force: Array, path: Motion) -> Array:
        """(B, N) N: the force, from that (B, N) of a film without memory of time.

        What would push is for the effect to give up: a slack film carries no force.
        """


class Compliance(Effect, ABC):
    """How far the frame yields."""

    stage = "compliance"

    @abstractmethod
    def yielding(self, p: Array, force: Array, peaks: Array) -> tuple[Array, Array]:
        """((B, N) m, (B, N) m/N): displacement of the frame under the film's force, and its derivative.

        ``peaks`` : (B, N) N, the largest force before each, or 0.
        """


class Sensor(Effect, ABC):
    """What the load cell adds."""

    stage = "sensor"

    @abstractmethod
    def read(self, p: Array, force: Array, path: Motion) -> Array:
        """(B, N) N: the reading, from the force (B, N) before this effect."""


STAGES: tuple[type[Effect], ...] = (Geometry, Deflection, Slack, Carried, Memory, Compliance, Sensor)


def ordered(effects: Sequence[Effect]) -> list[Effect]:
    """Effects in the order in which they act."""
    return sorted(effects, key=lambda e: (stage_number(e), e.rank, e.name))


def stage_number(effect: Effect) -> int:
    """Position of the effect's stage in `STAGES`."""
    return next(i for i, stage in enumerate(STAGES) if isinstance(effect, stage))
