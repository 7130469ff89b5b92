"""The verdict as sentences that an engineer can act on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from bayesmembrane.diagnosis.candidates import Candidate
from bayesmembrane.diagnosis.detection import Detection
from bayesmembrane.diagnosis.heldout import Error
from bayesmembrane.diagnosis.separation import Experiment
from bayesmembrane.diagnosis.trace import DECISIVE, Judged
from bayesmembrane.diagnosis.whitening import OwnNoise
from bayesmembrane.ground.registry import components

SHOWN = 3
HALF = 0.5  # unexplained: beyond it a candidate is no part of the answer
Shown = Mapping[str, tuple[float, str]]
SCALES: Shown = {"m": (1e3, "mm"), "m/N": (1e3, "mm/N"), "N": (1e3, "mN"), "N/s": (1e3, "mN/s")}
"""`Rig.shown` of a lifted disc."""


def sentence_of(
    verdict: str,
    members: Sequence[Candidate],
    null: Candidate,
    detection: Detection,
    before: Error,
    after: Error,
    shape: str,
    power: Mapping[str, float],
    nexts: Sequence[Experiment],
    partial: Judged | None,
    shown: Shown = SCALES,
    step: str = "",
) -> str:
    """What to read first: the verdict, how sure, how large, and what to do; in the units ``shown`` of the rig.

    ``step`` : a sentence on a sudden change that explains a curve nearly as well, or just as well if it is ambiguous
    """
    factor, unit = shown["N"]
    title = null.hypothesis.material.title
    have = " with " + " and ".join(e.title for e in null.hypothesis.effects) if null.hypothesis.effects else ""
    if verdict == "adequate":
        return (
            f"{title}{have} describes the curve to within its noise (p = {detection.p_value:.2g}; "
            f"{factor * before.rmse_N:.3g} {unit} root mean square). Nothing is seen to be missing. "
            f"{_power(power, shown)}"
        ).strip()
    start = f"{title}{have} misses something (p {_p(detection.p_value)}): "
    error = (
        f"The residual falls from {factor * before.rmse_N:.3g} to {factor * after.rmse_N:.3g} {unit} root mean square, "
        f"{after.reduced_chi2:.2f} in reduced chi-square."
    )
    if verdict == "named":
        text = f"{start}{_effects(members[0], null, shown)}. {error}{_bounds(members[0])}{_signature(members[0], null)}"
        return f"{text} {step}".rstrip()
    if verdict == "material":
        better = members[0].hypothesis.material.title
        return (
            f"{start}the energy {better} explains it without any added effect, better than or as well as an effect of "
            f"the instrument would. {error}{_bounds(members[0])} Use {better}, or show by another test that the family "
            f"is right before an instrument is blamed."
        )
    if verdict == "ambiguous":
        names = "; or ".join(_effects(m, null, shown) for m in members)
        foreign = "; or something from outside the film at one moment" if step else ""
        advice = f" To tell them apart: {nexts[0].sentence}." if nexts else ""
        text = f"{start}this measurement cannot tell which of these it is: {names}{foreign}. {error}{advice} {step}"
        return text.rstrip()
    if members:
        effects = members[0].hypothesis.effects
        names = " with ".join(e.title for e in effects)
        alone = "on this path its free law follows" if len(effects) == 1 else "together they follow"
        return (
            f"{start}{names} would imitate it, but {alone} the deflection alone, as a strain energy that "
            f"is not known here would do just as well. No name is given. {shape}"
        )
    nearest = _part(partial, null, shown)
    return f"{start}no known effect, no pair of effects and no other energy explains it.{nearest} {shape}"


def form_sentence(null: Candidate, left: float, detection: Detection) -> str:
    """Of a model that is adequate but for the form of its effects."""
    h = null.hypothesis
    have = " and ".join(e.title for e in h.effects)
    return (
        f"{h.material.title} with {have} leaves {100 * left:.1f} % of the misfit that {h.material.title} alone has "
        f"(p {_p(detection.p_value)}): no more than a machine leaves that differs a little from the textbook's form. "
        "Nothing beyond that is seen to be missing."
    )


def energy_sentence(better: Judged, best: Judged) -> str:
    """On another energy with which the same effect, or another one, is decisively more probable."""
    h = better.candidate.hypothesis
    return (
        f" The energy matters here: with {h.material.title} and {' and '.join(e.title for e in h.effects)} "
        f"the curve is more probable still, by {better.gain - best.gain:.3g} in ln K."
    )


def noise_sentence(noise: OwnNoise) -> str:
    """What the readings say against the stated noise; "" if nothing."""
    if noise.excess == 1:
        return ""
    found = [f"the readings scatter {noise.excess:.2f} times as much as the measurement states"]
    if noise.remembers:
        found.append(f"neighbouring readings are correlated ({noise.rho:.2f}), which it does not state")
    return f" Of the noise: {', and '.join(found)}; this is allowed for."


def _part(partial: Judged | None, null: Candidate, shown: Shown) -> str:
    """How far the best of the effects gets, where that is worth saying."""
    if partial is None or partial.log_evidence <= null.log_evidence + DECISIVE or partial.unexplained > HALF:
        return ""
    taken = 100 * (1 - partial.unexplained)
    return f" The nearest, {_effects(partial.candidate, null, shown)}, takes {taken:.0f} % of it and leaves the rest."


def _effects(candidate: Candidate, null: Candidate, shown: Shown) -> str:
    """Titles and sizes of the effects that a candidate adds."""
    have = {e.name for e in null.hypothesis.effects}
    values = candidate.parameters
    words = []
    for effect in candidate.hypothesis.effects:
        if effect.name in have:
            continue
        p = effect.size
        words.append(f"{effect.title} ({p.name} {size_in_words(values[f'{effect.name}.{p.name}'], p.unit, shown)})")
    other = candidate.hypothesis.material.title
    return " and ".join(words) + (f" with {other}" if other != null.hypothesis.material.title else "")


def size_in_words(value: float, unit: str, shown: Shown = SCALES) -> str:
    """A value in SI in the unit that people read."""
    factor, name = shown.get(unit, (1.0, unit.removeprefix("-")))
    # Of a stretch of 1.0026 three digits say nothing.
    digits = 5 if unit == "-" and abs(value - 1) < 0.1 else 3
    return f"{factor * value:.{digits}g} {name}".strip()


def _signature(candidate: Candidate, null: Candidate) -> str:
    have = {e.name for e in null.hypothesis.effects}
    told = [e.signature for e in candidate.hypothesis.effects if e.name not in have]
    return " " + " ".join(told)


def _bounds(candidate: Candidate) -> str:
    if not candidate.at_bound:
        return ""
    return f" An estimate lies at its bound ({', '.join(candidate.at_bound)}): take it as a limit, not as a value."


def _power(power: Mapping[str, float], shown: Shown) -> str:
    """The smallest sizes that would have shown, for the effects that are easiest to see relative to what is usual."""
    known = components("effects")
    relative = sorted((size / known[n]().size.scale, n, size) for n, size in power.items() if np.isfinite(size))
    sizes = [(known[n], size) for _, n, size in relative[:SHOWN]]
    words = [f"{e.title} of {size_in_words(size, e().size.unit, shown)}" for e, size in sizes]
    return f"It would have shown {', '.join(words)} or more." if words else ""


def _p(value: float) -> str:
    return "< 0.0001" if value < 1e-4 else f"= {value:.2g}"
