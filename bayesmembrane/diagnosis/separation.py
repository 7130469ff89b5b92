"""Which further measurement would tell rival explanations apart, found by simulating it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.motion import Motion
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.thresholds import NEXT_TEST
from bayesmembrane.ground.errors import BayesmembraneError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.effects.base import Compliance
from bayesmembrane.physics.forward import Forward, Solve
from bayesmembrane.physics.rigs.base import Rig, rig_of


@dataclass(frozen=True)
class Experiment:
    """A further measurement and how far apart it would put the nearest two rivals.

    separation : in standard deviations of the noise, after each rival has adapted its parameters; inf: one sees it bare
    """

    what: str
    separation: float


def experiments(measurement: Measurement, rivals: Sequence[Candidate], sd: float, solve: Solve) -> list[Experiment]:
    """Further measurements, the one that separates the nearest two rivals best first.

    Rival A makes the curve, and rival B is fitted to old and new points together, to first order: what B cannot follow,
    over the noise, is the separation.
    """
    out = []
    for what, path, rig in _protocols(measurement):
        try:
            trial = _trial(measurement, path, rig)
            distance = min(_separation(measurement, trial, a, b, sd, solve) for a, b in combinations(rivals, 2))
        except (BayesmembraneError, np.linalg.LinAlgError):
            continue
        if np.isfinite(distance):
            out.append(Experiment(what, float(distance)))
    frame = [any(isinstance(e, Compliance) for e in r.hypothesis.effects) for r in rivals]
    if any(frame) and not all(frame):
        out.append(Experiment("a blank run on a rigid dummy, which shows the frame's yielding alone", np.inf))
    return sorted(out, key=lambda e: -e.separation)


def _protocols(m: Measurement) -> list[tuple[str, Motion, Rig | None]]:
    """(in words, path, rig if it is another one)."""
    d, t = m.path.deflection, m.path.time
    top = float(np.max(d))
    up = np.linspace(top / NEXT_TEST.points, top, NEXT_TEST.points)
    speed = NEXT_TEST.usual_speed if t is None else float(np.median(m.path.speed))
    full = m.full_range

    def path(points: Array, factor: float = 1.0) -> Motion:
        steps = np.maximum(np.abs(np.diff(points, prepend=0.0)), 1e-9)
        return Motion(points, np.cumsum(steps) / (speed * factor), full)

    found: list[tuple[str, Motion, Rig | None]] = []
    cyclic = np.any(m.leg < 0)
    if not cyclic:
        found.append(("unloading after the same loading", path(np.concatenate([up, up[::-1]])), None))
    stairs = np.concatenate([np.concatenate([up[up <= p * top], up[up <= p * top][::-1]]) for p in NEXT_TEST.peaks])
    found.append(("unloading cycles to rising peaks", path(stairs), None))
    again = np.concatenate([up, up[::-1]]) if cyclic else up
    if t is not None:
        found.append((f"the same test {NEXT_TEST.faster:g} times faster", path(again, NEXT_TEST.faster), None))
    found += [(f"the same test {words}", path(again), rig) for words, rig in rig_of(m).variants()]
    return found


def _trial(m: Measurement, path: Motion, rig: Rig | None) -> Measurement:
    return Measurement(
        path.deflection,
        np.ones(path.deflection.size),
        rig or m.rig,
        m.specimen,
        time=path.time if m.path.time is not None else None,
        full_range=m.full_range,
    )


def _separation(m: Measurement, trial: Measurement, a: Candidate, b: Candidate, sd: float, solve: Solve) -> float:
    """|(F_A - F_B) of the new points, less what B's slopes on old and new points absorb| / sd."""
    old_difference = b.residual - a.residual
    parts, slopes = [old_difference], [b.slopes]
    forces = []
    for c in (a, b):
        p = Forward(c.hypothesis, trial, trial.deflection, solve)(c.x[None, :], sensitivities=True, reached=False)
        forces.append(p.force[0])
        assert p.sensitivity is not None
        sensitivity = p.sensitivity[0]
    parts.append(forces[0] - forces[1])
    slopes.append(sensitivity)
    difference, slope = np.concatenate(parts), np.concatenate(slopes)
    if not (np.all(np.isfinite(difference)) and np.all(np.isfinite(slope))):
        return np.inf
    scale = np.maximum(np.linalg.norm(slope, axis=0), 1e-300)
    fit = np.linalg.lstsq(slope / scale, difference, rcond=NEXT_TEST.rank)[0]
    return float(np.linalg.norm(difference - slope / scale @ fit)) / sd
