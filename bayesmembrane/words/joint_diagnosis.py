"""A diagnosis of several tests in sentences, and as the JSON answer of ``diagnose`` on them."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from bayesmembrane.diagnosis.explanation.telling import NOTHING
from bayesmembrane.diagnosis.joint.diagnose import DiagnosedTest, JointDiagnosis, JointMember
from bayesmembrane.diagnosis.thresholds import VERDICT, WORDS
from bayesmembrane.ground.registry import components
from bayesmembrane.words.diagnosis import (
    elsewhere,
    percent,
    probabilities_told,
    set_aside_sentence,
    set_title,
    shared,
    thinning_sentence,
)
from bayesmembrane.words.foreign import foreign_sentence
from bayesmembrane.words.hypothesis import effect_title, material_title
from bayesmembrane.words.language import listed, spoken_parameter
from bayesmembrane.words.seen import seen
from bayesmembrane.words.sizes import units_of
from bayesmembrane.words.units import read_as, read_as_by_test, size_in_words


def document(found: JointDiagnosis) -> dict[str, Any]:
    """Plain values: the JSON answer of ``diagnose`` on several tests."""
    left, nothing = found.remaining, {"heldout_before": None, "heldout_after": None, "heldout": "nothing"}
    return {
        "probabilities": {
            "effects": dict(found.probabilities.effects),
            "energies": dict(found.probabilities.energies),
            "foreign": dict(found.probabilities.foreign),
        },
        "remaining": {
            "share": left.share,
            "reduced_chi2": left.reduced_chi2,
            "words": remaining_sentence(found),
            "energy_error": left.energy_error,
            "law_errors": dict(left.law_errors),
        },
        "verdict": found.verdict,
        "effects": list(found.effects),
        "material": found.material,
        "sentence": sentence(found),
        "p_value": found.detection.p_value,
        "ranking": [
            {
                "effect": m.material if m.name == NOTHING else m.name,
                "material": m.material,
                "probability": m.probability,
                "log_bayes_factor": m.gain,
                "parameters": dict(m.parameters),
                "units": units_of(m.parameters),
                "unexplained": m.unexplained,
                "energy_error": m.energy_error,
                "law_errors": dict(m.law_errors),
                "at_bound": list(m.at_bound),
            }
            for m in found.ranking
        ],
        "confounded": [{"effects": [a, b], "degrees": round(v, 2)} for a, b, v in found.confounded],
        "error": {"before": asdict(found.before), "after": asdict(found.after), **nothing},
        "tests": {
            t.label: {
                "error": {"before": asdict(t.before), "after": asdict(t.after)},
                "noise": {"sd_N": t.noise_sd, "stated": t.stated},
                "set_aside_readings": 0 if t.set_aside is None else len(t.set_aside.numbers),
                "read_as": read_as(t.measurement.rig.shown(t.measurement.specimen.thickness)),
            }
            for t in found.tests
        },
        "read_as": read_as_by_test((t.label, t.measurement) for t in found.tests),
    }


def sentence(found: JointDiagnosis) -> str:
    """What to read first: how probable, the verdict, how large and in which test, what remains."""
    parts = [f"Probability: {', '.join(probabilities_told(found.probabilities))}.", _answer(found), _foreign(found)]
    if found.verdict != "adequate":
        parts += [_errors(found), remaining_sentence(found)]
    return " ".join(p for p in (*parts, *_left_out(found)) if p)


def remaining_sentence(found: JointDiagnosis) -> str:
    """What the answer leaves, of all tests together."""
    left = found.remaining
    text = f"Remaining: reduced chi-square {left.reduced_chi2:.2f}"
    if left.noise:
        return f"{text}: noise."
    forms = f"an error of {100 * left.energy_error:.2g} % in the energy"
    if laws := [f"{100 * e:.2g} % in {effect_title(n)}" for n, e in left.law_errors.items() if e > WORDS.law_error]:
        forms += f" and of {listed(laws)}"
    carries = "would carry it" if left.carried >= VERDICT.form_carries else "would not carry all of it"
    return f"{text}; {forms} {carries}."


def _answer(found: JointDiagnosis) -> str:
    tests = f"{listed(found.labels)} together"
    model = material_title(found.null)
    if found.verdict == "adequate":
        return f"One energy, {model}, describes {tests} to within their noise ({_p(found)})."
    misses = f"One energy, {model}, does not describe {tests} ({_p(found)})"
    if found.verdict == "named":
        return f"{misses}: {_member(found.members[0], found)}."
    if found.verdict == "material":
        return f"{misses}; the energy {material_title(found.material)} does, without any effect."
    if found.verdict == "ambiguous":
        names = [_member(m, found) for m in found.members[: WORDS.listed_sets]]
        more = len(found.members) - len(names)
        rest = f"; or one of {more} less probable sets" if more > 0 else ""
        rest += elsewhere(found.probabilities, {m.name for m in found.members})
        if len(found.members) == 1:
            return f"{misses}: most probably it is {names[0]}{rest}."
        return f"{misses}: {_common(found)}these tests cannot tell which of these it is: {'; or '.join(names)}{rest}."
    if found.members:
        return f"{misses}: {_member(found.members[0], found)} is the most probable, yet leaves too much to be named."
    sure = found.probabilities.nearly_certain()
    are = "is" if len(sure) == 1 else "are"
    beside = f" beside {set_title('+'.join(sure))}, which {are} in all that is probable" if sure else ""
    return f"{misses}, and no effect of the library, no energy and no small error of their forms does{beside}."


def _common(found: JointDiagnosis) -> str:
    """What is in every set of an ambiguous answer."""
    together = shared(found.probabilities, [set(m.name.split("+")) - {NOTHING} for m in found.members])
    return f"{together}, yet " if together else ""


def _member(member: JointMember, found: JointDiagnosis) -> str:
    """Titles and sizes of the effects, test by test, and the energy if that is another one."""
    known, words = components("effects"), []
    for name in [] if member.name == NOTHING else member.name.split("+"):
        own, _, label = name.partition("@")
        size = known[own]().size
        told = []
        for test, claim in zip(found.tests, member.tests, strict=True):
            if own not in [e.name for e in claim.effects] or label not in ("", test.label):
                continue
            full = [f"{own}@{test.label}.{size.name}", f"{own}.{size.name}"]
            value = next(member.parameters[n] for n in full if n in member.parameters)
            m = test.measurement
            shown = size_in_words(value, size.unit, m.rig.shown(m.specimen.thickness), size.null)
            told.append(shown if label else f"{shown} in {test.label}")
            if known[own].constant and full[1] in member.parameters:
                told = [shown]  # of the material, in all tests
        words.append(f"{effect_title(name)} ({spoken_parameter(f'{own}.{size.name}')} {listed(told)})")
    text = " and ".join(words) or "no effect"
    return text + (f" with {material_title(member.material)}" if member.material != found.null else "")


def _errors(found: JointDiagnosis) -> str:
    """How the residuals of every test fall; of an answer without a model how large they are."""
    known = found.verdict != "unknown"
    return f"Residuals, root mean square: {listed([_error(t, known) for t in found.tests])}."


def _error(test: DiagnosedTest, known: bool) -> str:
    before, after = (seen(test.measurement).error(m.rmse_N) for m in (test.before, test.after))
    return f"{test.label} {before} before and {after} after" if known else f"{test.label} {before}"


def _foreign(found: JointDiagnosis) -> str:
    f = found.foreign
    if f is None:
        return ""
    m = next(t.measurement for t in found.tests if t.label == f.label)
    p = found.probabilities.something_found
    how = f"In {f.label}" if p > 0.5 else f"Perhaps in {f.label} ({percent(p)})"
    return f"{how}: {foreign_sentence(f, m.rig, m.specimen.thickness)}"


def _left_out(found: JointDiagnosis) -> list[str]:
    out = []
    for t in found.tests:
        out += [f"{t.label}: {set_aside_sentence(t.set_aside)}"] if t.set_aside is not None else []
        out += [f"{t.label}: {thinning_sentence(t.thinned)}"] if t.thinned is not None else []
    return out


def _p(found: JointDiagnosis) -> str:
    p = found.detection.p_value
    return "p < 0.0001" if p < WORDS.smallest_p else f"p = {p:.2g}"
