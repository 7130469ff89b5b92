"""A diagnosis in sentences that an engineer can act on, and as the JSON answer of ``diagnose``."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from bayesmembrane.data.fixture import Fixture
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.standard import expected_size
from bayesmembrane.diagnosis.explanation.telling import ANOTHER_LAW, NOTHING, UNLISTED
from bayesmembrane.diagnosis.explanation.total import Judged, Probabilities, set_name
from bayesmembrane.diagnosis.left.heldout import HeldOut
from bayesmembrane.diagnosis.left.shape import resolution_of
from bayesmembrane.diagnosis.left.turning import at_a_turn
from bayesmembrane.diagnosis.reference.outliers import SetAside
from bayesmembrane.diagnosis.result import Diagnosis, Thinned
from bayesmembrane.diagnosis.separation import Experiment
from bayesmembrane.diagnosis.thresholds import NEXT_TEST, VERDICT, WORDS
from bayesmembrane.ground.registry import components
from bayesmembrane.words.foreign import foreign_sentence
from bayesmembrane.words.hypothesis import effect_title, material_title, spoken
from bayesmembrane.words.language import listed, spoken_parameter
from bayesmembrane.words.next_test import spoken_test
from bayesmembrane.words.shape import shape_in_words
from bayesmembrane.words.sizes import IMPLAUSIBLE, flagged_size, units_of
from bayesmembrane.words.units import Units, read_as, size_in_words

BLIND = (
    "It could not have shown any effect of a size that occurs: beside its noise, or with so few readings, nothing "
    "would be seen."
)
"""Of a measurement that is adequate whatever is there."""


def document(found: Diagnosis) -> dict[str, Any]:
    """Plain values: the JSON answer of ``diagnose``."""
    fit, waves, noise, held = found.detection.lack_of_fit, found.detection.periodicity, found.noise, found.validation
    thinned = {"thinning": thinning_sentence(found.thinned)} if found.thinned is not None else {}
    return thinned | {
        "probabilities": {
            "effects": dict(found.probabilities.effects),
            "energies": dict(found.probabilities.energies),
            "foreign": dict(found.probabilities.foreign),
            "none": found.probabilities.effects.get(NOTHING, 0.0),
        },
        "remaining": {
            "share": found.remaining.share,
            "reduced_chi2": found.remaining.reduced_chi2,
            "words": remaining_sentence(found),
            "energy_error": found.remaining.energy_error,
            "law_errors": dict(found.remaining.law_errors),
        },
        "set_aside_readings": 0 if found.set_aside is None else len(found.set_aside.numbers),
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
                "effect": "+".join(e.name for e in j.candidate.hypothesis.in_question)
                or j.candidate.hypothesis.material.name,
                "material": j.candidate.hypothesis.material.name,
                "probability": j.probability,
                "log_bayes_factor": j.gain,
                "parameters": (own := _not_known(j.candidate)),
                "units": units_of(own),
                "unexplained": j.unexplained,
                "energy_error": j.candidate.energy_error,
                "law_errors": j.candidate.law_errors,
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
        "smallest_visible_units": {n: components("effects")[n]().size.unit for n in found.power},
        "absorbed": absorbed_sentences(found),
        "unsought": list(found.unsought),
        "firm": list(found.firm),
        "read_as": read_as(_units(found)),
        "next_measurements": [
            {
                "what": spoken_test(e.test, found.rig),
                "separation": None if np.isinf(e.separation) else e.separation,
                "sentence": experiment_sentence(e, found.rig),
            }
            for e in found.experiments
        ],
    }


def _not_known(candidate: Candidate) -> dict[str, float]:
    """Parameters of the effects of a candidate but those that another run of the rig has measured."""
    return {k: v for k, v in candidate.parameters.items() if k not in candidate.hypothesis.known_coordinates}


def sentence(found: Diagnosis) -> str:
    """What to read first: how probable, the verdict, how large, what remains, what to do; in the units of the rig."""
    return f"{probability_sentence(found)} {_with_the_rest(_ANSWERS[found.verdict](found), found)}"


def finding_sentence(found: Diagnosis) -> str:
    """The same for those who have read the probabilities and the rivals: what was seen, how far the error falls."""
    if found.verdict != "ambiguous":
        return _with_the_rest(_ANSWERS[found.verdict](found), found)
    count = len(found.members)
    may_be = f"{_common(found)}any of {count} explanations may be right"
    if count == 1:
        may_be = "one explanation stands out, and another effect may be behind it"
    told = f"{_misses(found)}{may_be}. {_error(found)}{_beside(found)}"
    return _with_the_rest(told, found)


def _with_the_rest(answer: str, found: Diagnosis) -> str:
    """An answer with what it leaves, and what is to be known of noise and readings."""
    thinned = "" if found.thinned is None else f" {thinning_sentence(found.thinned)}"
    aside = "" if found.set_aside is None else f" {set_aside_sentence(found.set_aside)}"
    left = "" if found.verdict == "adequate" else f" {remaining_sentence(found)}"
    return f"{answer.strip()}{left}{_noise(found)}{_rounded(found)}{aside}{thinned}"


def _rounded(found: Diagnosis) -> str:
    """That readings are multiples of a step, where that makes a good part of their noise."""
    step = resolution_of(found.measurement.force)
    share = min(step**2 / 12 / max(float(np.median(found.noise.each)) ** 2, 1e-300), 1.0)
    if share < WORDS.rounded:
        return ""
    return (
        f" The readings are multiples of {size_in_words(step, 'N', _units(found))}, and {100 * share:.0f} % of their "
        "noise is that: a finer range of the load cell would show more."
    )


def probability_sentence(found: Diagnosis) -> str:
    """The most probable sets of effects, and what is foreign where it counts."""
    other = other_energy(found)
    told = probabilities_told(found.probabilities)
    return f"Probability: {', '.join(told)}.{f' Whatever is at work, {other}.' if other else ''}"


def probabilities_told(p: Probabilities) -> list[str]:
    """The most probable sets of effects, and what is foreign where it counts: ``viscoelastic relaxation 99 %``, ``alone
    60 %``, ``with friction in the guide 30 %``. What is in nearly all of them comes first, where no set is sure.
    """
    probable = [(name, q) for name, q in p.effects.items() if q >= WORDS.probable][:3]
    first = set(p.likely(WORDS.nearly_all))
    told = [f"{set_title(name)} {percent(q)}" for name, q in probable]
    in_sum, alone = p.of_effect(*first), p.effects.get("+".join(sorted(first)), 0.0)
    if first and alone < VERDICT.sure and in_sum >= max(WORDS.nearly_all, alone + WORDS.probable):
        told = [f"{set_title('+'.join(sorted(first)))} {percent(in_sum)}"]
        told += [f"{_beyond(first, name)} {percent(q)}" for name, q in probable]
    return [*told, *(f"{what} {percent(q)}" for what, q in foreign_told(p))]


_CONCLUDED = {ANOTHER_LAW: "a law that is not in the library", UNLISTED: "a fault that is not in the library"}


def foreign_told(p: Probabilities) -> list[tuple[str, float]]:
    """What is foreign, in words, and how probable, where it counts: what was found, and what is only concluded."""
    told = [("something foreign", p.something_found)]
    told += [(what, p.foreign.get(kind, 0.0)) for kind, what in _CONCLUDED.items()]
    return [(what, q) for what, q in told if q >= WORDS.probable]


def _beyond(first: set[str], name: str) -> str:
    """A set of effects after those of ``first`` were told."""
    rest = sorted(set(name.split("+")) - first)
    if not first <= set(name.split("+")):
        return set_title(name)
    return f"with {set_title('+'.join(rest))}" if rest else "alone"


def other_energy(found: Diagnosis) -> str:
    """``the energy is Gent (99.5 %), not neo-Hookean``: where effects stay open, and the declared energy is wrong."""
    declared, energies = found.null.hypothesis.material, found.probabilities.energies
    name = max(energies, key=lambda n: energies[n])
    sure = found.declared and name != declared.name and energies[name] >= VERDICT.sure
    if not sure or found.verdict != "ambiguous":
        return ""
    return f"the energy is {material_title(name)} ({percent(energies[name])}), not {declared.title}"


def set_title(name: str) -> str:
    """A set of effects by its name among the probabilities, as people say it."""
    return "no effect" if name == NOTHING else " and ".join(effect_title(n) for n in name.split("+"))


def percent(p: float) -> str:
    """A probability that is neither 0 nor 1."""
    if p > 1 - WORDS.nearly:
        return f"> {100 * (1 - WORDS.nearly):g} %"
    if p < WORDS.nearly:
        return f"< {100 * WORDS.nearly:g} %"
    text = f"{100 * p:.2g} %" if p < WORDS.digits_from else f"{100 * p:.3g} %"
    # What is not enough for a name must not look as if it were.
    return f"{100 * VERDICT.sure - 0.1:.3g} %" if p < VERDICT.sure and text == f"{100 * VERDICT.sure:g} %" else text


def remaining_sentence(found: Diagnosis) -> str:
    """How much the answer leaves, of what kind, and what of it a small error of the forms carries."""
    left = found.remaining
    factor, unit = _units(found)["N"]
    text = f"Remaining: reduced chi-square {left.reduced_chi2:.2f}"
    if left.share < WORDS.all_of_it:
        text += f", {100 * left.share:.2g} % of the misfit beyond noise"
    if left.noise or (found.verdict == "adequate" and found.detection.adequate):
        return f"{text}: noise."
    laws = [f"of {100 * e:.2g} % in {effect_title(n)}" for n, e in left.law_errors.items() if e > WORDS.law_error]
    forms = [f"an error of {100 * left.energy_error:.2g} % in the energy", *(f"one {w}" for w in laws)]
    if left.carried >= VERDICT.form_carries:
        return f"{text}; {' and '.join(forms)} would carry it ({factor * left.rms:.2g} {unit})."
    return f"{text}; not even {' and '.join(forms)} would carry all of it."


def set_aside_sentence(aside: SetAside) -> str:
    """How many readings were left out, which, and how far off they are."""
    count, listed = len(aside.numbers), aside.numbers[: WORDS.listed_readings]
    which = ", ".join(map(str, listed)) + (", ..." if count > len(listed) else "")
    return (
        f"Set aside as outliers: {count} of the {aside.measured} readings (number {which}), up to "
        f"{aside.farthest:.2g} standard deviations off their neighbours."
    )


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


def unsought_sentence(found: Diagnosis) -> str:
    """Which effects were not looked for, and what would show them; "" if there are none."""
    known = components("effects")
    named = listed(known[name].title for name in found.unsought)
    if not named:
        return ""
    speeds = any(known[name].needs_speeds for name in found.unsought)
    cure = "unload, or pull at another speed," if speeds else "unload"
    return f"Not looked for, since a test that only goes one way hides them: {named}; {cure} to see them."


def set_aside(held: HeldOut | None) -> str:
    """Which points were set aside before looking."""
    if held is None:
        return "nothing"
    if held.cycles == 1:
        return "every fourth block of points"
    return "the second cycle" if held.cycles == 2 else f"cycle {held.cycle}"


def experiment_sentence(experiment: Experiment, rig: Fixture) -> str:
    """What a further measurement would show."""
    if np.isinf(experiment.separation):
        return f"{spoken_test(experiment.test, rig)}: shows one of them directly"
    return f"{spoken_test(experiment.test, rig)}: {experiment.separation:.1f} standard deviations apart"


# ---- one answer for each verdict -------------------------------------------------------------------------------------


def _adequate(found: Diagnosis) -> str:
    factor, unit = _units(found)["N"]
    if not found.detection.adequate:
        return (
            f"{_model(found.null)} leaves more than noise (p {_p(found)}), but no effect is needed: "
            f"{remaining_sentence(found)[0].lower()}{remaining_sentence(found)[1:]} Nothing beyond that is seen to be "
            "missing."
        )
    return (
        f"{_model(found.null)} describes the curve to within its noise (p = {found.detection.p_value:.2g}; "
        f"{factor * found.before.rmse_N:.3g} {unit} root mean square). Nothing is seen to be missing. "
        f"{_power(found)}{_beside(found)}"
    )


def _named(found: Diagnosis) -> str:
    (member, *_) = (j.candidate for j in found.members)
    have = {e.name for e in found.null.hypothesis.effects}
    signatures = " ".join(e.signature for e in member.hypothesis.effects if e.name not in have)
    answer = f"{_misses(found)}{_added(member, found)}. {_error(found)}{_bounds(member)} {signatures}".rstrip()
    return f"{answer}{_beside(found)}"


def _material(found: Diagnosis) -> str:
    best = found.members[0].candidate
    better = best.hypothesis.material.title
    return (
        f"{_misses(found)}the energy {better} explains it without any added effect. {_error(found)}{_bounds(best)} "
        f"Use {better}, or show by another test that the family is right before an instrument is blamed."
    )


def _ambiguous(found: Diagnosis) -> str:
    told, more = found.members[: WORDS.listed_sets], len(found.members) - WORDS.listed_sets
    names = "; or ".join(_member(j, found) for j in told) + (
        f"; or one of {more} less probable sets" if more > 1 else "; or a less probable set" if more > 0 else ""
    )
    names += elsewhere(found.probabilities, {set_name(j.candidate, found.null.names) for j in found.members})
    lead = f"{_common(found)}this measurement cannot tell which of these it is:"
    if len(found.members) == 1:
        lead = "most probably it is"
    return f"{_misses(found)}{lead} {names}. {_error(found)}{_advice(found)}{_beside(found)}"


def elsewhere(p: Probabilities, members: Collection[str]) -> str:
    """What is told of other sets than the ``members`` of an ambiguous answer, by their names."""
    rest = sum(q for name, q in p.effects.items() if name not in members)
    return f"; or another set ({percent(rest)})" if rest > 1 - VERDICT.sure else ""


def shared(p: Probabilities, sets: Iterable[Collection[str]]) -> str:
    """``friction (93 %) is at work in each of these``: what is in all ``sets`` of an ambiguous answer, or ""."""
    names = sorted(set.intersection(*map(set, sets)))
    if not names:
        return ""
    return f"{set_title('+'.join(names))} ({percent(p.of_effect(*names))}) {_is_at_work(names)} each of these"


def _advice(found: Diagnosis) -> str:
    """The best of the further tests, and whether it is sure to tell explanations apart."""
    if not found.experiments:
        return ""
    best = found.experiments[0]
    if best.separation < NEXT_TEST.helps:
        return " No further test that was simulated tells them apart."
    lead = "To tell them apart" if best.separation >= NEXT_TEST.clear else "What helps most"
    return f" {lead}: {experiment_sentence(best, found.rig)}."


def _common(found: Diagnosis) -> str:
    """What is in every set of an ambiguous answer, or in most of all that is told."""
    p, given = found.probabilities, set(found.null.names)
    if together := shared(p, [set(j.candidate.names) - given for j in found.members]):
        return f"{together}, yet "
    likely = [f"{set_title(n)} ({percent(p.of_effect(n))})" for n in p.likely(WORDS.likely)]
    return f"{listed(likely)} {'is' if len(likely) == 1 else 'are'} in most of them, yet " if likely else ""


def _at_work(names: Sequence[str]) -> str:
    return f"{set_title('+'.join(names))} {_is_at_work(names)}"


def _is_at_work(names: Sequence[str]) -> str:
    return f"{'is' if len(names) == 1 else 'are'} at work in"


def _beside(found: Diagnosis) -> str:
    """What is foreign beside the effects, or may be."""
    if found.foreign is None:
        return ""
    p = found.probabilities.something_found
    how = "Beside it" if p > 0.5 else f"Perhaps beside it ({percent(p)})"
    return f" {how}: {foreign_sentence(found.foreign, found.rig, found.thickness)}"


def _member(j: Judged, found: Diagnosis) -> str:
    have = set(found.null.names)
    if set(j.candidate.names) == have:
        if _foreign_alone(found):
            return "no effect, but something foreign"
        material = j.candidate.hypothesis.material
        same = material is found.null.hypothesis.material
        if same:
            return f"no effect, but a form that is {100 * j.candidate.energy_error:.2g} % off {material.title}"
        return f"no effect, but the energy {material.title}"
    return _added(j.candidate, found)


def _foreign_alone(found: Diagnosis) -> bool:
    """True if nothing speaks for a model without effects but what is foreign beside it."""
    f, p = found.foreign, found.probabilities
    alone = f is not None and set_name(f.base, found.null.names) == NOTHING
    return alone and not found.detection.adequate and 0.99 * p.effects.get(NOTHING, 0.0) < p.something_found


def _unknown(found: Diagnosis) -> str:
    waves, units = found.detection.periodicity, _units(found)
    if found.foreign is not None and found.probabilities.something_found > 0.5:
        base = found.foreign.base.names
        beside = f" beside {' and '.join(effect_title(n) for n in base)}" if base else ""
        return (
            f"{_misses(found)}{_certain(found)}no effect of the library describes it{beside}. "
            f"{foreign_sentence(found.foreign, found.rig, found.thickness)}"
        )
    shape = shape_in_words(found.shape, waves, found.rig, units)
    if found.members:
        return (
            f"{_misses(found)}{_certain(found)}{_added(found.members[0].candidate, found)} would be the most probable, "
            f"but {why_not(found)}: no name is given. {shape}"
        )
    if found.probabilities.effects.get(NOTHING, 0.0) >= 0.5:
        return f"{_misses(found)}no effect is needed, and none of the energies has this form. {shape}"
    if far := why_none(found):
        return f"{_misses(found)}{_certain(found)}what fits best is no explanation, for {far}. {shape}"
    return (
        f"{_misses(found)}{_certain(found)}more explanations are about as probable than this measurement can part."
        f"{_advice(found)} {shape}"
    )


def why_none(found: Diagnosis) -> str:
    """Why the most probable explanation is none, as a clause: which forms are too far off; "" if it may be one."""
    fitted = {set_name(j.candidate, found.null.names): j for j in reversed(found.ranking)}
    told = next((fitted[name] for name in found.probabilities.effects if name in fitted), None)
    if told is None:
        return ""
    first = told.candidate
    far = laws_off(first.law_errors_beyond(found.null.names), VERDICT.law_carried)
    if first.energy_error > VERDICT.carried:
        far.insert(0, f"the energy {100 * first.energy_error:.2g} %")
    worse = "by its own laws it leaves more than no effect does" if told.worse else ""
    return f"it holds only with {listed(far)} off" if far else worse


def laws_off(errors: Mapping[str, float], least: float) -> list[str]:
    """``the law of viscoelastic relaxation 5 %`` of each effect whose law has a larger error than ``least``."""
    return [f"the law of {effect_title(n)} {100 * e:.2g} %" for n, e in errors.items() if e > least]


def why_not(found: Diagnosis) -> str:
    """Why the most probable explanation is not named, as a clause."""
    v = found.validation
    if v is not None and v.covered_after < VERDICT.least_coverage:
        return (
            f"its 90 % band holds only {100 * v.covered_after:.0f} % of the points that were set aside ({set_aside(v)})"
        )
    if found.members and (turned := at_a_turn(found.members[0].candidate, found.measurement)) is not None:
        return f"{turned.title} comes where the test turns, and what makes loops may leave as much there"
    left = found.remaining
    return f"what it leaves (reduced chi-square {left.reduced_chi2:.2f}) is no noise, and no small error of the forms"


def _certain(found: Diagnosis) -> str:
    """Effects that are in all that is probable: what is known where the whole is not."""
    sure, doubts = nearly_certain(found), doubtful(found)
    if not sure:
        return ""
    are, explain = ("is", "explains") if len(doubts) == 1 else ("are", "explain")
    which = f"{listed(map(effect_title, doubts))}, which {explain} hardly more than what is left"
    so = f", and so {are} {which} and may stand in for something else" if doubts else ""
    return f"{_at_work(sure)} all that is probable{so}, yet "


def nearly_certain(found: Diagnosis) -> list[str]:
    """Effects that are in all that is probable, but for the `doubtful`, and one that comes where the test turns."""
    turned = at_a_turn(found.ranking[0].candidate, found.measurement) if found.ranking else None
    doubts = doubtful(found)
    return [n for n in found.probabilities.nearly_certain() if n not in doubts and (turned is None or n != turned.name)]


def doubtful(found: Diagnosis) -> list[str]:
    """Effects in all of an `unknown` answer that explain hardly more than what is left, beside others that do."""
    if not found.firm or found.verdict != "unknown":
        return []
    return [n for n in found.probabilities.nearly_certain() if n not in found.firm]


_ANSWERS = {
    "adequate": _adequate,
    "named": _named,
    "material": _material,
    "ambiguous": _ambiguous,
    "unknown": _unknown,
}


# ---- parts -----------------------------------------------------------------------------------------------------------


def _units(found: Diagnosis) -> Units:
    return found.rig.shown(found.thickness)


def _model(candidate: Candidate) -> str:
    h = candidate.hypothesis
    return spoken(h)


def _misses(found: Diagnosis) -> str:
    model = _model(found.null) if found.declared else f"{_model(found.null)}, the nearest of all energies,"
    if found.detection.adequate:
        p = found.probabilities.effects
        first = max(p, key=lambda name: p[name], default=NOTHING) == NOTHING
        but = "and others do as well" if first else "but by parameters that are less probable than those of another one"
        return f"{model} follows the curve (p = {found.detection.p_value:.2g}), {but}: "
    return f"{model} misses something (p {_p(found)}): "


def _p(found: Diagnosis) -> str:
    value = found.detection.p_value
    return "< 0.0001" if value < WORDS.smallest_p else f"= {value:.2g}"


def _error(found: Diagnosis) -> str:
    factor, unit = _units(found)["N"]
    before, after = (factor * e.rmse_N for e in (found.before, found.after))
    if found.best.label == found.null.label:
        chi2 = f"{found.after.reduced_chi2:.2f} in reduced chi-square"
        return f"The first leaves {after:.3g} {unit} root mean square, {chi2}."
    return (
        f"The residual falls from {before:.3g} to {after:.3g} {unit} root mean square, "
        f"{found.after.reduced_chi2:.2f} in reduced chi-square."
    )


def _added(candidate: Candidate, found: Diagnosis) -> str:
    """Titles and sizes of the effects that a candidate adds, and its energy if that is another one."""
    null = found.null.hypothesis
    have = {e.name for e in null.effects}
    added = [e for e in candidate.hypothesis.effects if e.name not in have]
    words = [f"{e.title} ({flagged_size(e, candidate, found.measurement)})" for e in added]
    other = candidate.hypothesis.material.title
    return " and ".join(words) + (f" with {other}" if other != null.material.title else "")


def _bounds(candidate: Candidate) -> str:
    if not candidate.at_bound:
        return ""
    names = listed(map(spoken_parameter, candidate.at_bound))
    return f" An estimate lies at its bound ({names}): take it as a limit, not as a value."


def _power(found: Diagnosis) -> str:
    """The smallest sizes that would have shown, for the effects that are easiest to see relative to what is usual."""
    words = [f"{title} of {size}" for title, size in smallest_sizes(found)[: WORDS.visible_effects]]
    if words:
        return f"It would have shown {', '.join(words)} or more."
    return BLIND if found.power else ""


def smallest_sizes(found: Diagnosis) -> list[tuple[str, str]]:
    """(title of an effect, the smallest size that would have shown), the easiest to see beside what is usual first.

    Sizes that do not occur would not have shown.
    """
    known, units = components("effects"), _units(found)
    effects = {n: known[n]() for n, size in found.power.items() if np.isfinite(size)}
    times = {n: found.power[n] / expected_size(e, found.measurement) for n, e in effects.items()}
    order = sorted((n for n in effects if times[n] < IMPLAUSIBLE), key=lambda n: (times[n], n))
    sizes = {n: size_in_words(found.power[n], effects[n].size.unit, units) for n in order}
    bare = {n: f" ({spoken_parameter(f'{n}.{e.size.name}')})" for n, e in effects.items() if e.size.unit == "-"}
    return [(known[n].title, f"{sizes[n]}{bare.get(n, '')}") for n in order]


def _noise(found: Diagnosis) -> str:
    """What the readings say of the noise, beside what is stated; "" if nothing."""
    noise, words, stated = found.noise, [], found.measurement.force_sd
    if noise.excess != 1:
        words.append(f"the readings scatter {noise.excess:.2f} times as much as the measurement states")
        if noise.remembers:
            words.append(f"neighbouring readings are correlated ({noise.rho:.2f}), which it does not state")
    # What is stated of each reading is kept in proportion: only beside one number, or none, readings say what grows.
    if noise.profile.size > 1 and not noise.stated and (stated is None or np.ptp(stated) == 0):
        least, largest = (size_in_words(v, "N", _units(found)) for v in (np.min(noise.each), np.max(noise.each)))
        words.append(f"it grows with the force, from {least} to {largest}")
    return f" Of the noise: {', and '.join(words)}; this is allowed for." if words else ""
