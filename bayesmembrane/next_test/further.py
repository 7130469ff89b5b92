"""Further tests of a film: which there are, as values, and what each would measure, by simulation."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.motion import NOMINAL_SPEED
from bayesmembrane.data.sequence import one_after_another
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.forward import Forward, Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.rigs.base import Rig, rig_of

FURTHER = (1.25, 1.5)  # times the largest deflection so far
SMALL = 0.3  # of it: where the film is nearly linear
LEG = 240  # readings of a leg
PEAKS = (0.5, 0.75, 1.0, 1.0)  # what remembers the past shows on rising peaks, and on the repeated one
FASTER = 10.0  # a decade shows rate and relaxation
HELD = 2.0  # times the loading of the same test: as long is waited at the top, and at rest
WAIT = 120  # readings of a hold
SAME = 1e-9  # relative: deflections closer than this are one


class Kind(Enum):
    """What is done in a further test."""

    REPEAT = "repeat"
    FURTHER = "further range"
    SMALL = "small deflections"
    OTHER_RIG = "other rig"
    UNLOADING = "unloading"
    CYCLES = "cycles"
    FASTER = "faster"
    HOLD = "hold"
    OTHER_SIZE = "other size"
    BLANK = "blank run"


@dataclass(frozen=True)
class FurtherTest:
    """A measurement that could be made next; what a kind does not need stays as it is.

    kind : what is done
    start, end : m, between which deflections
    beyond : whether that is further than the film was ever tested
    speed : times the present one
    hold : s for which the disc stands still at the top, and then at rest, before all is done again without holds
    rig : name of another rig, for another specimen of the same film
    stretch : how far that specimen is pulled
    change : what another size of the same rig is, in the words of `Rig.variants`
    """

    kind: Kind
    start: float = 0.0
    end: float = 0.0
    beyond: bool = False
    speed: float = 1.0
    hold: float = 0.0
    rig: str = ""
    stretch: float = 1.0
    change: str = ""


@dataclass(frozen=True, eq=False)
class Signals:
    """What B films would show at M readings.

    force : (B, M) N, or tensions in N/m of another specimen
    slopes : (B, M, k) its derivatives in the coordinates that shape the curve
    sensors : how many load cells give M / sensors readings each, one after the other
    """

    force: Array
    slopes: Array
    sensors: int = 1

    def over_noise(self, share: float) -> Array:
        """``slopes`` over a noise that is the ``share`` of the largest force of each film and load cell."""
        count, readings = self.force.shape
        parts = np.abs(self.force).reshape(count, self.sensors, readings // self.sensors)
        sd = share * np.repeat(np.max(parts, axis=2), readings // self.sensors, axis=1)
        return np.asarray(self.slopes / sd[:, :, None])


@dataclass(frozen=True, eq=False)
class Simulation(ABC):
    """A further ``test``, ready to be simulated."""

    test: FurtherTest

    @abstractmethod
    def signals(self, hypothesis: Hypothesis, x: Array, solve: Solve) -> Signals:
        """Of the films with coordinates x (B, k); nan where there is none. Raises what `Forward` raises."""


@dataclass(frozen=True, eq=False)
class OnFilm(Simulation):
    """A test of the same film: ``measurement`` tells rig and motion, ``deflection`` (M,) m where it is read."""

    measurement: Measurement
    deflection: Array

    def signals(self, hypothesis: Hypothesis, x: Array, solve: Solve) -> Signals:
        forward = Forward(hypothesis, self.measurement, self.deflection, solve)
        found = forward(x, sensitivities=True, reached=False)
        assert found.sensitivity is not None
        return Signals(found.force, found.sensitivity)


@dataclass(frozen=True, eq=False)
class OnSpecimen(Simulation):
    """Another specimen of the film of ``measurement``, pulled to ``stretch`` (M,) on the ``rig``, as that proposes it.

    The tensions P_i = dW/dl_i are closed forms; effects of the present test play no part.
    """

    measurement: Measurement
    rig: type[Rig]
    stretch: Array

    def signals(self, hypothesis: Hypothesis, x: Array, solve: Solve) -> Signals:
        across, sensors = self.rig.proposed(self.stretch)
        material, films = hypothesis.material, hypothesis.films(x).T[:, :, None]
        along, across = self.stretch[None, :], across[None, :]
        shape = (len(x), self.stretch.size)
        with np.errstate(all="ignore"):
            tensions = material.derivatives(films, along, across)
            parts = material.sensitivities(films, along, across)
        force = np.concatenate([np.broadcast_to(tensions[i], shape) for i in sensors], axis=1)
        by_film = [np.stack([np.broadcast_to(part[i], shape) for part in parts], axis=2) for i in sensors]
        films_by_coordinates = Forward(hypothesis, self.measurement, self.measurement.deflection, solve).jacobian(x)
        slopes = np.einsum("bmp,bpj->bmj", np.concatenate(by_film, axis=1), films_by_coordinates)
        return Signals(force, slopes, len(sensors))


# ---- which tests there are -------------------------------------------------------------------------------------------


def same_again(m: Measurement) -> OnFilm:
    """The same test once more."""
    return OnFilm(FurtherTest(Kind.REPEAT), m, m.deflection)


def other_ranges(m: Measurement) -> Iterator[OnFilm]:
    """The same film further than before, and at small deflections; as many readings as before."""
    end, readings = float(np.max(m.deflection)), len(m)
    known = {m.full_range} if m.full_range > end * (1 + SAME) else set()
    for to in sorted({end * f for f in FURTHER} | known):
        beyond = to > m.full_range * (1 + SAME)
        yield _between(m, FurtherTest(Kind.FURTHER, end, to, beyond), readings)
    yield _between(m, FurtherTest(Kind.SMALL, 0.0, SMALL * end), readings)


def other_specimens(m: Measurement, stretch: float) -> Iterator[OnSpecimen]:
    """Other specimens of the film up to ``stretch``, on every rig that proposes a test; as many readings as before."""
    rigs: list[type[Rig]] = [r for r in components("rigs").values() if r.proposal]
    at = np.linspace(1, stretch, len(m) + 1)[1:]
    for rig in rigs:
        yield OnSpecimen(FurtherTest(Kind.OTHER_RIG, rig=rig.name, stretch=stretch), m, rig, at)


def other_motions(m: Measurement) -> Iterator[OnFilm]:
    """The same film and range, moved in another way after what was measured, and anew on the variants of its rig."""
    top = float(np.max(m.path.deflection))
    up = np.linspace(top / LEG, top, LEG)
    there_and_back = np.concatenate([up, up[::-1]])
    cyclic = bool(np.any(m.leg < 0))
    if not cyclic:
        yield _moved(m, FurtherTest(Kind.UNLOADING), there_and_back)
    peaks = [up[up <= p * top] for p in PEAKS]
    yield _moved(m, FurtherTest(Kind.CYCLES), np.concatenate([leg for p in peaks for leg in (p, p[::-1])]))
    again = there_and_back if cyclic else up
    if m.path.time is not None:
        yield _moved(m, FurtherTest(Kind.FASTER, speed=FASTER), again)
        wait = HELD * top / _speed(m)
        standing = [np.full(WAIT, at) for at in (top, 0.0)]
        twice = [up, standing[0], up[::-1], standing[1], up, up[::-1]]
        yield _moved(m, FurtherTest(Kind.HOLD, hold=wait), np.concatenate(twice))
    for words, rig in rig_of(m).variants():
        test = FurtherTest(Kind.OTHER_SIZE, change=words)
        trial = _test(replace(m, rig=rig), test, again)
        yield OnFilm(test, trial, trial.deflection)


def _between(m: Measurement, test: FurtherTest, readings: int) -> OnFilm:
    """Evenly between start and end; one path of its own, whose range is not that of the measurement."""
    at = np.linspace(test.start, test.end, readings + 1)[1:]
    return OnFilm(test, replace(m, full_range=float(np.max(at))), at)


def _moved(m: Measurement, test: FurtherTest, deflection: Array) -> OnFilm:
    """Through ``deflection``, by a film that remembers what was done to it before."""
    before = replace(m, force_sd=None, covariance=None)
    both = one_after_another([before, _test(m, test, deflection)])
    trial = both.select(np.arange(len(m), len(both)))
    return OnFilm(test, trial, trial.deflection)


def _test(m: Measurement, test: FurtherTest, deflection: Array) -> Measurement:
    """Readings at ``deflection``, at the speed of the measurement times that of the test; what stands there more than
    once in a row is waited for.
    """
    steps = np.abs(np.diff(deflection, prepend=0.0))
    time = None
    if m.path.time is not None:
        moving = np.maximum(steps, 1e-9) / (test.speed * _speed(m))
        time = np.cumsum(np.where(steps > 0, moving, np.maximum(moving, test.hold / WAIT)))
    force, reach = np.ones(deflection.size), m.full_range
    return Measurement(deflection, force, m.rig, m.specimen, time=time, full_range=reach, blank_run=m.blank_run)


def _speed(m: Measurement) -> float:
    """m/s, of the disc."""
    return NOMINAL_SPEED if m.path.time is None else float(np.median(m.path.speed))
