"""What could explain a residual, in words: candidates, how large they are, and what would tell them apart."""

from __future__ import annotations

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.explanation.total import set_name
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.diagnosis.thresholds import NEXT_TEST
from bayesmembrane.words.diagnosis import experiment_sentence, percent, set_aside, set_title
from bayesmembrane.words.hypothesis import spoken
from bayesmembrane.words.language import listed, spoken_parameter, three_digits
from bayesmembrane.words.next_test import spoken_test
from bayesmembrane.words.seen import seen
from bayesmembrane.words.sizes import flagged_size


def candidate_title(candidate: Candidate, null: Candidate) -> str:
    """What a candidate adds to the model as it was."""
    have = {e.name for e in null.hypothesis.effects}
    added = [e.title for e in candidate.hypothesis.effects if e.name not in have]
    if candidate.hypothesis.material is not null.hypothesis.material:
        added.append(f"the energy {candidate.hypothesis.material.title}")
    return " and ".join(added) or "nothing: the model as it was"


def sizes(candidate: Candidate, d: Diagnosis) -> list[str]:
    """``slip 0.0021``: sizes of the effects that a candidate adds, in the units that people read, flagged."""
    have = {e.name for e in d.null.hypothesis.effects}
    added = [e for e in candidate.hypothesis.effects if e.name not in have]
    return [flagged_size(e, candidate, d.measurement) for e in added]


def rivals(d: Diagnosis) -> list[str]:
    """The ambiguous set, and what to measure to tell its members apart."""
    told = []
    given = d.null.names
    for j in d.members:
        name = set_name(j.candidate, given)
        p = percent(d.probabilities.effects.get(name, 0.0))  # summed over all energies
        other = j.candidate.hypothesis.material is not d.null.hypothesis.material
        which = [f"most probably with {j.candidate.hypothesis.material.title}"] if other else []
        how = ", ".join([*sizes(j.candidate, d), *which])
        told.append(f"{set_title(name)}{f' ({how})' if how else ''}: {p}.")
    clear = [e for e in d.experiments if e.separation >= NEXT_TEST.clear]
    helps = [e for e in d.experiments if NEXT_TEST.helps <= e.separation < NEXT_TEST.clear]
    rest = [e for e in d.experiments if e.separation < NEXT_TEST.helps]
    told += [f"To tell them apart: {experiment_sentence(e, d.rig)}." for e in clear]
    if not clear and len(d.members) > 1:
        told.append("None of the further tests that were simulated is sure to tell them apart.")
    for words, dim in (("What helps, and may not decide", helps), ("What would not settle it", rest)):
        if dim:
            shown = [f"{spoken_test(e.test, d.rig)} ({e.separation:.1f} standard deviations)" for e in dim]
            told.append(f"{words}: {listed(shown)}.")
    return told


def validation_sentence(d: Diagnosis) -> str:
    """Which points were set aside, and whether the others choose the same model; "" where none were or nothing was
    chosen.
    """
    if d.validation is None or d.verdict in ("adequate", "unknown"):
        return ""
    v = d.validation
    factor, unit = seen(d.measurement).small
    names = {c.hypothesis.label(): spoken(c.hypothesis) for c in (j.candidate for j in d.ranking)}
    chosen = names.get(v.chosen, v.chosen)
    same = (
        f"the others choose the same model, {chosen}"
        if v.chosen == d.best.hypothesis.label()
        else f"the others choose {chosen} instead: the choice rests on the points left out"
    )
    before, after = (three_digits(factor * e.rmse_N) for e in (v.before, v.after))
    fall = f"their root mean square goes from {before} to {after} {unit}"
    return f"Set aside before looking: {set_aside(v)}. Without these points {same}; {fall}."


def bounds(d: Diagnosis) -> list[str]:
    """Estimates at a bound, of the model as given and of all that the answer rests on."""
    return [
        f"{spoken(c.hypothesis)}: the estimate of {listed(spoken_parameter(n) for n in c.at_bound)} lies at its bound. "
        "Take it as a limit, not as a value."
        for c in [d.null, *(j.candidate for j in d.members)]
        if c.at_bound
    ]
