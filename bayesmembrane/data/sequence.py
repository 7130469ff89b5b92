"""Tests of one film on one rig, made one after another without taking it out: one measurement, which remembers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from bayesmembrane.data.measurement import Measurement, Provenance
from bayesmembrane.data.motion import Motion
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array

RETURN_SPEED = 1e-3
"""m/s at which the disc counts as brought back where no reading tells how fast the test before was."""


def read_one_after_another(curves: Sequence[str | Path], specimen: str | Path, rest: float = 0.0) -> Measurement:
    """The tests in the files ``curves`` of the film in ``specimen``; raises what reading them and joining them does.

    And `DataError` for a file that is named twice: its readings would count twice.
    """
    files = [Path(curve).resolve() for curve in curves]
    if twice := next((f for f in files if files.count(f) > 1), None):
        raise DataError("the file is named twice, and its readings would count twice", str(twice), "name it once")
    return one_after_another([read_measurement(curve, specimen) for curve in curves], rest)


def one_after_another(tests: Sequence[Measurement], rest: float = 0.0) -> Measurement:
    """All readings of ``tests``, in this order, as one measurement of one film.

    Between two tests the disc goes back to zero, as fast as the first of them was, and rests there for ``rest`` s; a
    test whose clock goes on from the one before keeps its times. A film that was tested again is not as new: effects
    of history see the whole way.

    Raises `DataError` for tests on different rigs or films of different thickness, tests of which only some have times
    or a stated noise, and tests with stretches across.
    """
    first = tests[0]
    for number, test in enumerate(tests[1:], 2):
        _check(first, test, number)
    if len(tests) == 1:
        return first
    stations = [_Stations(first.path.deflection, first.path.time, first.on_path)]
    for before, test in pairwise(tests):
        stations.append(_after(stations[-1], before, test, rest))
    full_range = max(t.full_range for t in tests)
    places = np.concatenate([s.places for s in stations])
    deflection = np.concatenate([s.deflection for s in stations])
    time = None if first.time is None else np.concatenate([s.time for s in stations if s.time is not None])
    said = _said(tests, stations) if any(t.path.said for t in tests) else (None, None)
    return Measurement(
        np.concatenate([t.deflection for t in tests]),
        np.concatenate([t.force for t in tests]),
        first.rig,
        first.specimen,
        time=None if time is None else time[places],
        force_sd=_noise([t.force_sd for t in tests]),
        covariance=_covariance(tests),
        provenance=_origin(tests),
        full_range=full_range,
        motion=Motion(deflection, time, full_range, None, *said),
        places=places,
        blank_run=next((t.blank_run for t in tests if t.blank_run is not None), None),
    )


def _said(tests: Sequence[Measurement], stations: Sequence[_Stations]) -> tuple[Array, Array]:
    """Legs and cycles of the whole way, where they were said of some test; the way back belongs to the cycle before."""
    legs, cycles, last = [], [], 0
    for test, s in zip(tests, stations, strict=True):
        back = s.deflection.size - test.path.deflection.size
        legs += [np.full(back, -1.0), test.path.leg.astype(float)]
        cycles += [np.full(back, float(last)), test.path.cycle + float(last)]
        last += int(np.max(test.path.cycle))
    return np.concatenate(legs), np.concatenate(cycles)


@dataclass(frozen=True, eq=False)
class _Stations:
    """Where the disc was, (S,) m and s, and at which of these the readings are; ``start`` is the first one's place."""

    deflection: Array
    time: Array | None
    at: NDArray[np.int64]
    start: int = 0

    @property
    def places(self) -> NDArray[np.int64]:
        """Of the readings, on the whole way."""
        return self.at + self.start

    @property
    def end(self) -> int:
        """The place after the last one."""
        return self.start + self.deflection.size


def _after(last: _Stations, before: Measurement, test: Measurement, rest: float) -> _Stations:
    """The way back to zero, if no reading was made there, and the way of ``test``."""
    path = test.path
    timed = last.time is not None and path.time is not None
    goes_on = last.time is not None and path.time is not None and float(path.time[0]) > float(last.time[-1])
    down = float(last.deflection[-1]) == 0.0 and (goes_on or not timed)
    back = float(path.deflection[0]) != 0.0 and not down
    way = np.concatenate([[0.0], path.deflection]) if back else path.deflection
    places = test.on_path + back
    if last.time is None or path.time is None:
        return _Stations(way, None, places, last.end)
    speed = float(np.median(before.path.speed)) or RETURN_SPEED
    home = float(last.time[-1]) + abs(float(last.deflection[-1])) / speed + max(rest, 1e-6)
    # The way to the first reading is made as fast as the readings after it.
    lead = float(path.clock[0]) if back else 0.0
    time = path.time if goes_on else path.time + (home + lead - float(path.time[0]))
    if back:
        begun = max(float(time[0]) - lead, 0.5 * (float(last.time[-1]) + float(time[0])))
        time = np.concatenate([[begun], time])
    return _Stations(way, time, places, last.end)


def _differ(a: Array | None, b: Array | None) -> bool:
    """True if there are both, and not the same."""
    return a is not None and b is not None and not np.array_equal(a, b)


def _check(first: Measurement, test: Measurement, number: int) -> None:
    where = test.provenance.curve or f"test {number}"
    if repr(test.rig) != repr(first.rig):
        raise DataError(
            "a test of the same film is made on the same rig, and this one says another",
            where,
            "calibrate tests on different rigs as measurements of their own",
        )
    if test.specimen.thickness != first.specimen.thickness:
        raise DataError(
            f"the film is {1e6 * test.specimen.thickness:g} um thick here and "
            f"{1e6 * first.specimen.thickness:g} um in the test before: they are not the same",
            where,
        )
    if _differ(test.blank_run, first.blank_run):
        raise DataError("tests of the same film have one frame, and this one has another blank run", where)
    if (test.time is None) != (first.time is None):
        raise DataError("of tests made one after another all or none need times", where, "add a column time_s, or none")
    if (test.force_sd is None) != (first.force_sd is None):
        raise DataError("of tests made one after another all or none need a stated noise", where)
    if test.across is not None or first.across is not None:
        raise DataError("biaxial states are not tests that follow one another", where)


def _noise(every: Sequence[Array | None]) -> Array | None:
    stated = [sd for sd in every if sd is not None]
    return np.concatenate(stated) if stated else None


def _covariance(tests: Sequence[Measurement]) -> Array | None:
    if all(t.covariance is None for t in tests):
        return None
    parts = [t.noise_covariance for t in tests]
    return np.asarray(block_diag(*[p for p in parts if p is not None]))


def _origin(tests: Sequence[Measurement]) -> Provenance:
    first = tests[0].provenance
    names = " and ".join(t.provenance.curve for t in tests if t.provenance.curve)
    counts = ", ".join(str(len(t)) for t in tests)
    note = f"{len(tests)} tests of one film, made one after another, of {counts} readings"
    notes = dict.fromkeys(n for t in tests for n in t.provenance.notes)
    return replace(first, curve=names, notes=(*notes, note))
