"""A diagnosis in sentences that an engineer can act on, and as the JSON answer of ``diagnose``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.sudden import SuddenChange
from bayesmembrane.diagnosis.left.heldout import HeldOut
from bayesmembrane.diagnosis.result import Diagnosis, Thinned
from bayesmembrane.diagnosis.separation import Experiment
from bayesmembrane.diagnosis.thresholds import EXPLANATION, WORDS
from bayesmembrane.ground.registry import components
from bayesmembrane.words.hypothesis import spoken, title
from bayesmembrane.words.language import listed
from bayesmembrane.words.next_test import spoken_test
from bayesmembrane.words.shape import shape_in_words

Units = Mapping[str, tuple[float, str]]
"""By SI unit, (factor, unit) in which people read it: `Fixture.shown`."""

SCALES: Units = {"m": (1e3, "mm"), "m/N": (1e3, "mm/N"), "N": (1e3, "mN"), "N/s": (1e3, "mN/s")}
"""Those of a lifted disc."""


def document(found: Diagnosis) -> dict[str, Any]:
    """Plain values: the JSON answer of ``diagnose``."""
    fit, waves, noise, held = found.detection.lack_of_fit, found.detection.periodicity, found.noise, found.validation
    thinned = {"thinning": thinning_sentence(found.thinned)} if found.thinned is not None else {}
    return thinned | {
        "verdict": found.verdict,
        "effects": list(found.effects),
        "material": found.material,
        "sentence": sentence(found),
        "p_value": found.detection.p_value,
        "tests": {
            "lack_of_fit": {"ratio": fit.ratio, "p_value": fit.p_value},
            "score": asdict(found.detection.score),
            "periodicity": None if waves is None else asdict(waves),
        },
        "ranking": [
            {
                "effect": "+".join(j.candidate.names) or j.candidate.hypothesis.material.name,
                "material": j.candidate.hypothesis.material.name,
                "log_bayes_factor": j.log_evidence - found.null.log_evidence,
                "parameters": j.candidate.parameters,
                "unexplained": j.unexplained,
                "explains": j.explains,
                "at_bound": list(j.candidate.at_bound),
            }
            for j in found.ranking
        ],
        "confounded": [{"effects": [a, b], "degrees": round(v, 2)} for a, b, v in found.confounded],
        "error": {
            "before": asdict(found.before),
            "after": asdict(found.after),
            "heldout_before": None if held is None else asdict(held.before),
            "heldout_after": None if held is None else asdict(held.after),
            "heldout": set_aside(held),
            "chosen_without_heldout": None if held is None else held.chosen,
            "heldout_coverage_90_before": None if held is None else held.covered_before,
            "heldout_coverage_90_after": None if held is None else held.covered_after,
        },
        "noise": {"sd_N": noise.sd, "rho": noise.rho, "stated": noise.stated, "times_stated": noise.excess},
        "smallest_visible": dict(found.power),
        "absorbed": absorbed_sentences(found),
        "next_measurements": [
            {
                "what": spoken_test(e.test),
                "separation": None if np.isinf(e.separation) else e.separation,
                "sentence": experiment_sentence(e),
            }
            for e in found.experiments
        ],
    }


def sentence(found: Diagnosis) -> str:
    """What to read first: the verdict, how sure, how large, and what to do; in the units of the rig."""
    text = _form(found, found.form) if found.form is not None else _ANSWERS[found.verdict](found)
    thinned = "" if found.thinned is None else f" {thinning_sentence(found.thinned)}"
    return text.strip() + _better_energy(found) + _noise(found) + thinned


def thinning_sentence(thinned: Thinned) -> str:
    """Which readings of a long measurement were taken."""
    used, measured = thinned.used, thinned.measured
    return (
        f"{used} of the {measured} readings were diagnosed, one in {measured / used:.2g}: evenly along the test, with "
        "its first and last, its turning points and the ends of its holds; effects of history still follow all of them."
    )


def absorbed_sentences(found: Diagnosis) -> list[str]:
    """Why no residual shows the effects that the material absorbs."""
    known = components("effects")
    return [known[name].absorbed for name in found.absorbed]


def set_aside(held: HeldOut | None) -> str:
    """Which points were set aside before looking."""
    if held is None:
        return "nothing"
    if held.cycles == 1:
        return "every fourth block of points"
    return "the second cycle" if held.cycles == 2 else f"cycle {held.cycle}"


def experiment_sentence(experiment: Experiment) -> str:
    """What a further measurement would show."""
    if np.isinf(experiment.separation):
        return f"{spoken_test(experiment.test)}: shows one of them directly"
    return f"{spoken_test(experiment.test)}: {experiment.separation:.1f} standard deviations apart"


def size_in_words(value: float, unit: str, shown: Units = SCALES) -> str:
    """A value in SI in the unit that people read."""
    factor, name = shown.get(unit, (1.0, unit.removeprefix("-")))
    digits = 5 if unit == "-" and abs(value - 1) < WORDS.near_one else 3
    return f"{factor * value:.{digits}g} {name}".strip()


def sudden_sentence(change: SuddenChange, shown: Units) -> str:
    """When, how large, and what makes such a step."""
    factor, unit = shown["N"]
    when = f"reading {change.place + 1}" if change.moment is None else f"{change.moment:.4g} s"
    size = f"{100 * abs(change.size):.2g} %" if change.relative else f"{factor * abs(change.size):.3g} {unit}"
    return (
        f"A sudden {'rise' if change.size > 0 else 'drop'} of the force by {size} at {when} takes "
        f"{100 * change.share:.0f} % of the squares away: look for a change of temperature, a knock or a tear then."
    )


# ---- one answer for each verdict -------------------------------------------------------------------------------------


def _adequate(found: Diagnosis) -> str:
    factor, unit = _units(found)["N"]
    return (
        f"{_model(found.null)} describes the curve to within its noise (p = {found.detection.p_value:.2g}; "
        f"{factor * found.before.rmse_N:.3g} {unit} root mean square). Nothing is seen to be missing. "
        f"{_power(found)}"
    )


def _named(found: Diagnosis) -> str:
    (member, *_) = (j.candidate for j in found.members)
    have = {e.name for e in found.null.hypothesis.effects}
    signatures = " ".join(e.signature for e in member.hypothesis.effects if e.name not in have)
    return (
        f"{_misses(found)}{_added(member, found)}. {_error(found)}{_bounds(member)} {signatures} {_sudden(found)}"
    ).rstrip()


def _material(found: Diagnosis) -> str:
    best = found.members[0].candidate
    better = best.hypothesis.material.title
    return (
        f"{_misses(found)}the energy {better} explains it without any added effect, better than or as well as an "
        f"effect of the instrument would. {_error(found)}{_bounds(best)} Use {better}, or show by another test that "
        f"the family is right before an instrument is blamed."
    )


def _ambiguous(found: Diagnosis) -> str:
    names = "; or ".join(_added(j.candidate, found) for j in found.members)
    foreign = "" if found.sudden is None else "; or something from outside the film at one moment"
    nexts = found.experiments
    advice = f" To tell them apart: {experiment_sentence(nexts[0])}." if nexts else ""
    return (
        f"{_misses(found)}this measurement cannot tell which of these it is: {names}{foreign}. {_error(found)}"
        f"{advice} {_sudden(found)}"
    ).rstrip()


def _unknown(found: Diagnosis) -> str:
    waves, units = found.detection.periodicity, _units(found)
    shape = f"{shape_in_words(found.shape, waves, found.rig, units)} {_sudden(found)}".rstrip()
    if not found.members:
        return (
            f"{_misses(found)}no known effect, no pair of effects and no other energy explains it."
            f"{_nearest(found)} {shape}"
        )
    effects = found.members[0].candidate.hypothesis.effects
    names = " with ".join(e.title for e in effects)
    alone = "on this path its free law follows" if len(effects) == 1 else "together they follow"
    return (
        f"{_misses(found)}{names} would imitate it, but {alone} the deflection alone, as a strain energy that "
        f"is not known here would do just as well. No name is given. {shape}"
    )


_ANSWERS = {
    "adequate": _adequate,
    "named": _named,
    "material": _material,
    "ambiguous": _ambiguous,
    "unknown": _unknown,
}


def _form(found: Diagnosis, left: float) -> str:
    """Of a model that is adequate but for the form of its effects."""
    h = found.null.hypothesis
    return (
        f"{spoken(h)} leaves {100 * left:.1f} % of the misfit that {h.material.title} alone has "
        f"(p {_p(found)}): no more than a machine leaves that differs a little from the textbook's form. "
        "Nothing beyond that is seen to be missing."
    )


# ---- parts -----------------------------------------------------------------------------------------------------------


def _units(found: Diagnosis) -> Units:
    return found.rig.shown(found.thickness)


def _model(candidate: Candidate) -> str:
    h = candidate.hypothesis
    return spoken(h)


def _misses(found: Diagnosis) -> str:
    return f"{_model(found.null)} misses something (p {_p(found)}): "


def _p(found: Diagnosis) -> str:
    value = found.detection.p_value
    return "< 0.0001" if value < WORDS.smallest_p else f"= {value:.2g}"


def _error(found: Diagnosis) -> str:
    factor, unit = _units(found)["N"]
    before, after = (factor * e.rmse_N for e in (found.before, found.after))
    return (
        f"The residual falls from {before:.3g} to {after:.3g} {unit} root mean square, "
        f"{found.after.reduced_chi2:.2f} in reduced chi-square."
    )


def _added(candidate: Candidate, found: Diagnosis) -> str:
    """Titles and sizes of the effects that a candidate adds, and its energy if that is another one."""
    null, units = found.null.hypothesis, _units(found)
    have = {e.name for e in null.effects}
    values = candidate.parameters
    words = []
    for effect in candidate.hypothesis.effects:
        if effect.name in have:
            continue
        p = effect.size
        words.append(f"{effect.title} ({p.name} {size_in_words(values[f'{effect.name}.{p.name}'], p.unit, units)})")
    other = candidate.hypothesis.material.title
    return " and ".join(words) + (f" with {other}" if other != null.material.title else "")


def _bounds(candidate: Candidate) -> str:
    if not candidate.at_bound:
        return ""
    return f" An estimate lies at its bound ({', '.join(candidate.at_bound)}): take it as a limit, not as a value."


def _sudden(found: Diagnosis) -> str:
    return "" if found.sudden is None else sudden_sentence(found.sudden, _units(found))


def _nearest(found: Diagnosis) -> str:
    """How far the best of the effects gets, where that is worth saying."""
    best = next((j for j in found.ranking if j.candidate.names != found.null.names), None)
    if best is None or best.log_evidence <= found.null.log_evidence + EXPLANATION.decisive:
        return ""
    if best.unexplained > WORDS.partial:
        return ""
    taken = 100 * (1 - best.unexplained)
    return f" The nearest, {_added(best.candidate, found)}, takes {taken:.0f} % of it and leaves the rest."


def _power(found: Diagnosis) -> str:
    """The smallest sizes that would have shown, for the effects that are easiest to see relative to what is usual."""
    known, units = components("effects"), _units(found)
    relative = sorted((size / known[n]().size.scale, n, size) for n, size in found.power.items() if np.isfinite(size))
    sizes = [(known[n], size) for _, n, size in relative[: WORDS.visible_effects]]
    words = [f"{e.title} of {size_in_words(size, e().size.unit, units)}" for e, size in sizes]
    return f"It would have shown {', '.join(words)} or more." if words else ""


def _better_energy(found: Diagnosis) -> str:
    """On another energy with which the same effect, or another one, is decisively more probable."""
    if found.better is None:
        return ""
    h = found.better.candidate.hypothesis
    return (
        f" The energy matters here: with {title(h.material)} and {listed(map(title, h.effects))} "
        f"the curve is more probable still, by {found.better.gain - found.members[0].gain:.3g} in ln K."
    )


def _noise(found: Diagnosis) -> str:
    """What the readings say against the stated noise; "" if nothing."""
    noise = found.noise
    if noise.excess == 1:
        return ""
    words = [f"the readings scatter {noise.excess:.2f} times as much as the measurement states"]
    if noise.remembers:
        words.append(f"neighbouring readings are correlated ({noise.rho:.2f}), which it does not state")
    return f" Of the noise: {', and '.join(words)}; this is allowed for."
