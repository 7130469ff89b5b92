"""Real cyclic tests of VHB 4910: what one rate shows to be missing, and whether that predicts the other rates.

    python -m tests.studies.vhb [--seed 0]

writes docs/studies/vhb.md. The measurements lie in ../shared/data/effects and are no part of the project.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.diagnose import diagnose
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.registry import ordinary_materials
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.words.diagnosis import sentence
from tests.studies.vhb_data import FOLDER, RIG, Cycle, cycles, fast_cycle, kPa

TARGET = Path(__file__).resolve().parents[2] / "docs" / "studies" / "vhb.md"
FIRST = "yeoh"

EXPLAINED = 0.2
"""Of the squares beyond noise that the plain model leaves: what an explanation leaves at most."""

SHOWN = 3
"""Of the members of an ambiguous answer, the most probable ones."""


@dataclass(frozen=True, eq=False)
class Tried:
    """One model, fitted to one cycle.

    energy, effects : what it is made of
    explains, member : it leaves little of the misfit, `EXPLAINED`; the verdict rests on it
    size : its effects in words
    inside : kPa, root mean square of the residual of its own cycle
    outside : by rate, the same of the cycles to that peak at the other rates, nothing refitted
    low : by rate, kPa by which the prediction lies below the measured loading leg on average
    """

    energy: str
    effects: tuple[str, ...]
    explains: bool
    member: bool
    size: str
    inside: float
    outside: dict[float, float]
    low: dict[float, float]

    @property
    def predicted(self) -> float:
        """kPa: root mean square over the other rates; inf where there is no curve."""
        return float(np.sqrt(np.mean(np.square(list(self.outside.values())))))


@dataclass(frozen=True, eq=False)
class Trial:
    """What the diagnosis of one cycle with one energy came to; ``plain`` is the energy alone.

    again, more : verdict of a second diagnosis, of the model with what was named, and what that adds; "" and none if
        nothing was named, or it was not asked
    """

    energy: str
    peak: float
    rate: float
    verdict: str
    plain: Tried
    tried: tuple[Tried, ...]
    again: str = ""
    more: tuple[Tried, ...] = ()

    @property
    def members(self) -> tuple[Tried, ...]:
        """The models that the verdict rests on, the first `SHOWN`; none of an `adequate` or `unknown` one."""
        return tuple(t for t in self.tried if t.member)[:SHOWN]


@dataclass(frozen=True, eq=False)
class Quick:
    """The quick cycle: its diagnosis, the best single effect, and how a model of the slower cycles predicts it.

    verdict, sentence : of its own diagnosis
    plain, best : the energy alone, and the most probable model that was refitted
    end : stretch up to which it is predicted
    before, after : kPa, root mean square error there, of the energy alone and of what was found at the slower rate
    level : kPa, root mean square of the stress there
    """

    verdict: str
    sentence: str
    plain: Tried
    best: Tried
    end: float
    before: float
    after: float
    level: float


def main() -> None:
    """Fit, predict, and write the page."""
    from tests.studies.vhb_page import page

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    seed = parser.parse_args().seed
    found = cycles()
    if not found:
        print(f"Skipped: the measurements are not in {FOLDER}.")
        return
    trials = []
    for name in [FIRST, *(n for n in ordinary_materials() if n != FIRST)]:
        for cycle in found:
            trials.append(trial(cycle, found, name, seed, twice=name == FIRST))
            last = trials[-1]
            print(
                f"{name}, {cycle.peak} at {cycle.rate}/s: {last.verdict} {[m.effects for m in last.members]}",
                flush=True,
            )
    fast = quick(fast_cycle(), found[-1], seed)
    print(fast.sentence)
    TARGET.write_text(page(found, trials, fast, seed), encoding="utf-8")


def trial(cycle: Cycle, found: Sequence[Cycle], name: str, seed: int, twice: bool = False) -> Trial:
    """Calibrate and diagnose on one cycle, and predict those to the same peak at other rates; ``twice`` as the loop."""
    told = diagnose(cycle.measurement, hypothesis(name), seed=seed)
    others = [c for c in found if c.peak == cycle.peak and c is not cycle]
    tried = tuple(_tried(j.candidate, told, cycle, others, j.unexplained <= EXPLAINED) for j in told.ranking)
    plain = _tried(told.null, told, cycle, others, False)
    if not twice or told.verdict not in ("named", "material"):
        return Trial(name, cycle.peak, cycle.rate, told.verdict, plain, tried)
    second = diagnose(cycle.measurement, told.hypothesis, seed=seed)
    more = tuple(_tried(j.candidate, second, cycle, others, j.unexplained <= EXPLAINED) for j in second.ranking)
    return Trial(name, cycle.peak, cycle.rate, told.verdict, plain, tried, second.verdict, more)


def _tried(
    candidate: Candidate, told: Diagnosis, cycle: Cycle | None, others: Sequence[Cycle], explains: bool
) -> Tried:
    outside, low = {}, {}
    for other in others:
        miss = other.measurement.force - predicted(candidate, other.measurement, cycle.measurement.full_range)
        outside[other.rate] = rms(miss)
        low[other.rate] = float(kPa(np.mean(miss[other.measurement.leg > 0])))
    known = told.verdict in ("named", "ambiguous", "material")
    member = known and any(candidate.label == j.candidate.label for j in told.members)
    return Tried(
        candidate.hypothesis.material.name,
        candidate.names,
        explains,
        member,
        _size(candidate),
        rms(candidate.residual),
        outside,
        low,
    )


def predicted(candidate: Candidate, target: Measurement, full_range: float) -> np.ndarray:
    """(N,) N: forces of the fitted model in another test, with the histories' scale of the one it was fitted to."""
    same = replace(target, full_range=full_range)
    forward = Forward(candidate.hypothesis, same, same.deflection)
    return forward(candidate.x[None, :], reached=False).force[0]


def rms(residual: np.ndarray) -> float:
    """kPa: root mean square of residuals in N; inf where a model has no curve."""
    size = float(kPa(np.sqrt(np.mean(residual**2))))
    return size if np.isfinite(size) else float("inf")


def _size(candidate: Candidate) -> str:
    """The parameters of the effects; lengths and forces as stretch and stress."""
    shown = RIG.shown(1e-3)
    words = []
    for effect in candidate.hypothesis.effects:
        for p in effect.coordinates:
            factor, _ = shown.get(p.unit, (1.0, ""))
            unit = {"s": " s", "N": " kPa", "N/s": " kPa/s"}.get(p.unit, "")
            words.append(f"{p.name} {factor * candidate.parameters[f'{effect.name}.{p.name}']:.3g}{unit}")
    return ", ".join(words)


def quick(fast: Measurement, slower: Cycle, seed: int) -> Quick:
    """The quick cycle by itself, and its loading leg as a model of the slower cycle predicts it."""
    own = diagnose(fast, hypothesis(FIRST), seed=seed)
    told = diagnose(slower.measurement, hypothesis(FIRST), seed=seed)
    end = slower.measurement.full_range
    part = fast.select((fast.leg > 0) & (fast.deflection <= end))
    errors = [rms(part.force - predicted(c, part, end)) for c in (told.null, told.best)]
    best = next(j for j in own.ranking if j.candidate.names)
    return Quick(
        own.verdict,
        sentence(own),
        _tried(own.null, own, None, [], False),
        _tried(best.candidate, own, None, [], best.unexplained <= EXPLAINED),
        1 + end / RIG.length,
        errors[0],
        errors[1],
        rms(part.force),
    )


if __name__ == "__main__":
    main()
