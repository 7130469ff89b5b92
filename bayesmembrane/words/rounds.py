"""What the rounds of a closed loop say beside their verdicts: how it ended, what was held out, how sure the film is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayesmembrane.diagnosis.loop import Loop, Round, Stage
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.diagnosis.thresholds import WORDS
from bayesmembrane.words.candidates import bounds, validation_sentence
from bayesmembrane.words.diagnosis import finding_sentence
from bayesmembrane.words.hypothesis import effect_title, spoken
from bayesmembrane.words.language import listed
from bayesmembrane.words.moved import modulus_fitted, modulus_of, moved_sentences, settled
from bayesmembrane.words.seen import seen


def answer(found: Loop) -> list[str]:
    """What was found and added, with the size, and how it ended."""
    told = [finding_sentence(_settled(r)) + _firm(r) for r in found.rounds]
    told = [told[0], *(f"With that: {s}" for s in told[1:])]
    last = found.rounds[-1]
    if last.changed:
        told.append(
            f"The loop stops after {len(found.rounds)} round{'s' if len(found.rounds) > 1 else ''}: whether "
            f"{spoken(last.after.run.hypothesis)} is adequate has not been asked."
        )
    return told


def _firm(r: Round) -> str:
    """What is added although there is no name."""
    if not r.changed or r.diagnosis.explains:
        return ""
    firm = r.diagnosis.firm
    are, explain = ("is", "explains") if len(firm) == 1 else ("are", "explain")
    titles = listed(map(effect_title, firm))
    return f" Added {are} {titles}, which {are} in all that is probable and {explain} more than what is left."


def _settled(r: Round) -> Diagnosis:
    """The diagnosis of a round with the size of what was then added as it was sampled."""
    d = r.diagnosis
    if not (r.changed and d.explains):
        return d
    first, *others = d.members
    return replace(d, members=(replace(first, candidate=settled(first.candidate, r.after.run)), *others))


def subject(found: Loop) -> str:
    """Film, model, readings and range that a loop started from."""
    m, first = found.rounds[0].before.run.measurement, found.rounds[0].diagnosis
    end = seen(m).place(float(np.max(m.deflection)))
    model = spoken(first.null.hypothesis) if first.declared else "no energy declared"
    return f"{m.specimen.name}, {model}, {len(m)} readings up to {end}"


def validation_sentences(found: Loop) -> list[str]:
    """Which points were set aside in each round, and whether the others choose the same model."""
    told = [s for s in (validation_sentence(r.diagnosis) for r in found.rounds) if s]
    if not told and found.rounds[-1].diagnosis.validation is None:
        told.append("No points were set aside: there are too few.")
    return told


def bound_sentences(found: Loop) -> list[str]:
    """Estimates at a bound, of the models on the way and of all that an answer rests on."""
    return list(dict.fromkeys(s for r in found.rounds for s in bounds(r.diagnosis)))


def moved(found: Loop) -> list[str]:
    """How the material moved from the first posterior to the last, and why that matters."""
    before, after = stages(found)
    return moved_sentences(before.run, after.run) if any(r.changed for r in found.rounds) else []


def rival_sentences(found: Loop) -> list[str]:
    """What the modulus is under each explanation of an ambiguous answer: whether the choice matters for the film."""
    last = found.rounds[-1]
    if not last.leaders:
        return _fitted_rivals(last)
    every = [(spoken(s.run.hypothesis), modulus_of(s.run)) for s in (last.before, *last.leaders)]
    values = "; ".join(f"{mean:.4g} +- {sd:.2g} MPa in {name}" for name, (mean, sd) in every)
    means, sds = np.array([m for _, m in every[1:]]).T
    apart = float(np.ptp(means))
    matters = apart > float(np.max(sds))
    end = "Which of them is right decides the modulus." if matters else "Which of them is right matters little for it."
    return [f"The shear modulus is {values}. {end}"]


def _fitted_rivals(last: Round) -> list[str]:
    """The same of rivals that were fitted and not sampled: how far they are apart, not how sure each is."""
    d = last.diagnosis
    if d.verdict != "ambiguous":
        return []
    told = [j.candidate for j in d.members[: WORDS.listed_sets]]
    moduli = [modulus_fitted(c, d.measurement) for c in told]
    fitted = listed(f"{g:.4g} MPa in {spoken(c.hypothesis)}" for g, c in zip(moduli, told, strict=True))
    (mean, sd), model = modulus_of(last.before.run), spoken(last.before.run.hypothesis)
    apart = f"{100 * np.ptp(moduli) / np.mean(moduli):.0f} % apart from end to end"
    spread = "" if len(told) == 1 else f" Those fitted lie {apart}."
    return [f"The shear modulus is {mean:.4g} +- {sd:.2g} MPa in {model}; as fitted, not sampled, {fitted}.{spread}"]


def deciding(loop: Loop) -> Diagnosis:
    """The diagnosis in which something was found: the last that is not `adequate`, or the last."""
    found = [r.diagnosis for r in loop.rounds if r.diagnosis.verdict != "adequate"]
    return found[-1] if found else loop.rounds[-1].diagnosis


def stages(loop: Loop) -> tuple[Stage, Stage]:
    """The first and the last posterior; the same if nothing was added."""
    return loop.rounds[0].before, loop.rounds[-1].after
