"""Columns and lines of a preamble that say the same thing twice, and the rows in which they do not agree."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bayesmembrane.data.motion import legs
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.units import UNITS

APART = 0.02
"""Two columns contradict each other where they differ by more than this part of the larger one's range."""
SPEED_APART = 0.10
JUMP, STEPS, FEWEST = 0.02, 5.0, 20
"""A reading that leaves its neighbours by this part of the range, and so many times the usual step, and comes back;
of fewer readings no step is usual."""
REGULAR, SKIPS = 0.01, 5
"""Times whose steps differ by no more than this part are regular, and so few steps of twice the size are gaps."""


def contradiction(
    what: str, said: Array, other: Array, lines: Sequence[int], unit: str = "", tolerance: float = APART
) -> str:
    """A sentence on the rows in which ``said`` (N,) and ``other`` (N,), in SI, differ; "" if they agree.

    ``what`` names both, "A and B"; ``unit``, as `ground.units` spells it, is the one that numbers are shown in.
    """
    reach = max(float(np.ptp(said)), float(np.ptp(other)), 1e-300)
    difference = np.abs(said - other)
    bad = np.flatnonzero(~(difference <= tolerance * reach))
    if bad.size == 0:
        return ""
    worst = int(bad[np.argmax(difference[bad])])
    where = f"line {lines[bad[0]]}" if bad.size == 1 else f"lines {lines[bad[0]]} to {lines[bad[-1]]}"
    return (
        f"{what} contradict each other in {bad.size} of {said.size} rows ({where}; "
        f"most in line {lines[worst]}: {_shown(said[worst], unit)} against {_shown(other[worst], unit)})"
    )


def _shown(value: float, unit: str) -> str:
    """A value in SI as a number of a unit: ``3.42 MPa``."""
    name = {"percent": "%", "1": "", "one": ""}.get(unit, unit.replace("_per_", "/"))
    return f"{value / UNITS[unit].factor if name else value:.4g} {name}".rstrip()


def gauge_length_behind(travel: Array, strain: Array) -> tuple[float, float]:
    """(L, scatter): the length in m for which strain = travel / L, and the part of the range by which it fails."""
    t, e = travel - travel[0], strain - strain[0]
    if not np.any(e) or not np.any(t):
        return np.nan, np.inf
    length = float(np.dot(t, t) / np.dot(t, e)) if np.dot(t, e) > 0 else np.nan
    return length, float(np.max(np.abs(t / length - e)) / np.ptp(e)) if np.isfinite(length) else np.inf


def logarithmic_length_behind(travel: Array, strain: Array) -> tuple[float, float]:
    """The same for strain = ln(1 + travel / L), by the end of the largest strain."""
    t, e = travel - travel[0], strain - strain[0]
    k = int(np.argmax(np.abs(e)))
    if not abs(e[k]) > 0 or abs(e[k]) > 5:
        return np.nan, np.inf
    length = float(t[k] / np.expm1(e[k]))
    if not (np.isfinite(length) and length > 0) or np.any(t <= -length):
        return np.nan, np.inf
    return length, float(np.max(np.abs(np.log1p(t / length) - e)) / np.ptp(e))


def speed_against(travel: Array, time: Array, speed: float, lines: Sequence[int]) -> str:
    """A sentence if the travel (N,) m of the first way does not go on with ``speed`` (m/s), "" if it does."""
    first = int(np.argmax(np.append(legs(travel - travel[0]) < 0, True)))
    if first < 5:
        return ""
    t, x = time[:first] - time[0], np.abs(travel[:first] - travel[0])
    return contradiction(
        f"the stated speed of {6e4 * speed:.4g} mm/min times the time and the travel",
        speed * t,
        x,
        lines[:first],
        "mm",
        SPEED_APART,
    )


def jumps(what: str, values: Array, lines: Sequence[int]) -> str:
    """A sentence on readings that leave their neighbours and come back at once; "" if there are none."""
    step, least = _steps(values)
    near = np.minimum(step[:-1], step[1:])
    bad = 1 + np.flatnonzero((near > least) & (np.abs(values[2:] - values[:-2]) < 0.5 * near))
    if bad.size == 0:
        return ""
    named = ", ".join(f"{lines[k]}" for k in bad[:5]) + (" and more" if bad.size > 5 else "")
    return (
        f"the {what} leaves its neighbours and comes back at once in line {named}: damaged, or an event of the machine"
    )


def far_ends(what: str, values: Array, lines: Sequence[int]) -> str:
    """A sentence on a first or last reading that is as far from the one beside it as a jump; "" if neither is."""
    step, least = _steps(values)
    ends = {"first": (0, "a steep start"), "last": (-1, "a break")}
    far = {name: (lines[k], event) for name, (k, event) in ends.items() if step.size and step[k] > least}
    if not far:
        return ""
    named = " and ".join(f"the {name} reading (line {line})" for name, (line, _) in far.items())
    events = ", ".join(event for _, event in far.values())
    return f"the {what} goes far in one step at {named}: {events}, or damaged"


def _steps(values: Array) -> tuple[Array, float]:
    """(sizes of the steps between readings, the size beyond which one is unusual)."""
    step = np.abs(np.diff(values))
    if values.size < FEWEST:
        return step, np.inf
    reach = float(np.ptp(np.sort(values)[1:-1]))
    return step, max(STEPS * float(np.quantile(step, 0.9)), JUMP * reach)


def gaps(time: Array, lines: Sequence[int]) -> str:
    """A sentence on times that go on in equal steps and skip one here and there; "" if they do not."""
    step = np.diff(time)
    if step.size < 20:
        return ""
    low, usual, high = np.quantile(step, (0.1, 0.5, 0.9)).tolist()
    wide = np.flatnonzero(step > 1.9 * usual)
    if high - low > REGULAR * usual or not 0 < wide.size <= SKIPS:
        return ""
    named = ", ".join(f"{lines[k]}" for k in wide.tolist())
    return f"the times go on in steps of {usual:.4g} s and skip more after line {named}: lines may be missing"
