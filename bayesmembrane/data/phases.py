"""The phases of a test, to be looked at: legs, cycles, times at which the disc stands, and where they were read off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.data.fixture import Fixture
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.motion import reached
from bayesmembrane.data.thinning import thinned
from bayesmembrane.ground.parameters import Array

SHOWN = 2000
"""Readings that a picture needs, at most."""


@dataclass(frozen=True, eq=False)
class Phases:
    """What was done to a film.

    Attributes
    ----------
    name, thickness, rig, origin : the film (m), what held it, and where the measurement comes from
    time : (N,) s, or None
    deflection, force : (N,) m and N, at most `SHOWN` readings with all turning points
    leg, cycle : (N,) +1 or -1; from 1
    still : (N,) the disc stands
    reached : (N,) m, the largest deflection so far
    said : which of "direction" and "cycle" a column of the curve says; the others are read off
    jitter : m, a reversal smaller than this is no leg
    readings : how many there are in all
    """

    name: str
    thickness: float
    rig: Fixture
    origin: str
    time: Array | None
    deflection: Array
    force: Array
    leg: NDArray[np.int8]
    cycle: NDArray[np.int64]
    still: NDArray[np.bool_]
    reached: Array
    said: tuple[str, ...]
    jitter: float
    readings: int

    @property
    def parts(self) -> list[NDArray[np.intp]]:
        """The readings of each phase: of one leg and cycle, or of one time at which the disc stands."""
        keys = np.stack([np.where(self.still, 0, self.leg), np.where(self.still, 0, self.cycle)])
        changes = np.any(np.diff(keys, axis=1) != 0, axis=0)
        return list(np.split(np.arange(self.deflection.size), np.flatnonzero(changes) + 1))


def phases_of(measurement: Measurement) -> Phases | None:
    """The phases of a measurement; None if it is loaded once and nothing else, or if its readings are no path."""
    m = measurement
    if not m.rig.has_path or not (np.any(m.leg < 0) or m.path.said or m.holds):
        return None
    stands = np.zeros(len(m), dtype=bool)
    for hold in m.holds:
        stands[hold] = True
    few = thinned(m, SHOWN)
    at = few.on_path if few is not m else np.arange(len(m))
    index = np.searchsorted(m.on_path, at) if few is not m else at
    said = [name for name, v in (("direction", m.path.said_leg), ("cycle", m.path.said_cycle)) if v is not None]
    return Phases(
        name=m.specimen.name,
        thickness=m.specimen.thickness,
        rig=m.rig,
        origin=m.provenance.origin,
        time=None if m.time is None else m.time[index],
        deflection=m.deflection[index],
        force=m.force[index],
        leg=m.leg[index],
        cycle=m.cycle[index],
        still=stands[index],
        reached=reached(m.deflection)[index],
        said=tuple(said),
        jitter=m.path.jitter,
        readings=len(m),
    )
