"""What one reads who has two minutes: what was tested, the answer and what it leaves, what to do next.

Made of a diagnosis or a loop alone. The table and the picture that belong to it are in the report.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayesmembrane.calibration.run import Run
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.explanation.foreign import Foreign
from bayesmembrane.diagnosis.explanation.telling import NOTHING
from bayesmembrane.diagnosis.explanation.total import set_name
from bayesmembrane.diagnosis.left.shape import ResidualShape, residual_shape
from bayesmembrane.diagnosis.loop import Loop, Stage
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.diagnosis.thresholds import NEXT_TEST, VERDICT, WORDS
from bayesmembrane.words import language
from bayesmembrane.words.diagnosis import (
    foreign_told,
    laws_off,
    nearly_certain,
    other_energy,
    percent,
    set_title,
    smallest_sizes,
    why_none,
    why_not,
)
from bayesmembrane.words.foreign import ADVICE, foreign_clause
from bayesmembrane.words.hypothesis import effect_title, spoken
from bayesmembrane.words.language import listed
from bayesmembrane.words.moved import MATTERS, modulus_of, settled
from bayesmembrane.words.next_test import spoken_test
from bayesmembrane.words.seen import MEASURED, seen
from bayesmembrane.words.shape import PARTS
from bayesmembrane.words.sizes import bound_of_material as _bound
from bayesmembrane.words.sizes import flagged_size, hardly_met

ROOM = 82
"""Words for all sentences: with its table and its picture a first screen stays below 120."""
TELLING = 0.1
"""By how much an effect must be more probable in all than alone, for both to be told."""
FAR_APART = 10.0
"""Standard deviations from which it is not told by how much a test would tell explanations apart."""
ANSWERED = ("named", "material", "ambiguous")
"""Verdicts that rest on another model than the one that was given."""


@dataclass(frozen=True)
class Detail:
    """What is told on a first screen; what is not, is below.

    told, sized : explanations whose probability is told, and effects whose size is told with it
    places, sums : whether it is told where, and in which laws, something is left; and what is probable in all
    """

    told: int = 3
    sized: int = 3
    places: bool = True
    sums: bool = True


DETAILS = (
    Detail(),
    Detail(sized=1),
    Detail(2, 1),
    Detail(2, 0),
    Detail(1, 0),
    Detail(1, 0, places=False),
    Detail(1, 0, places=False, sums=False),
)
"""The first of these is told for which there is room."""


@dataclass(frozen=True)
class Brief:
    """The sentences of a first screen.

    tested : film, readings, range, model
    probable : what each round named, then the most probable explanations of the last, each with its probability
    verdict : what that comes to, a clause without its end
    left : that end: how much the answer leaves, where, of what kind
    following : what to do next
    """

    tested: str
    probable: tuple[str, ...]
    verdict: str
    left: str
    following: str

    @property
    def answer(self) -> str:
        """Probabilities and verdict, a sentence without its end."""
        return f"{'; '.join(self.probable)}: {self.verdict}"

    @property
    def spoken_verdict(self) -> str:
        """The verdict with a capital, for a line of its own."""
        return f"{self.verdict[:1].upper()}{self.verdict[1:]}"

    @property
    def lines(self) -> list[str]:
        """The sentences."""
        return [self.tested, f"{self.answer}, {self.left}.", self.following]

    @property
    def fits(self) -> bool:
        """True if there is room for it."""
        return len(" ".join(self.lines).split()) <= ROOM


@dataclass(frozen=True)
class Course:
    """The diagnoses that a first screen is about: the ``first``, those by which something was added, and the ``last``.

    detail : what is told of them
    sampled : the posterior of the last model, if there is one: its means are the sizes that are told
    """

    first: Diagnosis
    added: tuple[Diagnosis, ...]
    last: Diagnosis
    detail: Detail = Detail()
    sampled: Run | None = None

    @property
    def before(self) -> list[Diagnosis]:
        """Those by which something had been added before the one that the verdict rests on."""
        return [d for d in self.added if d is not self.telling]

    @property
    def telling(self) -> Diagnosis:
        """The one that the verdict rests on."""
        ended = self.added and self.added[-1].explains and self.last.verdict == "adequate"
        return self.added[-1] if ended else self.last


def of_diagnosis(d: Diagnosis) -> Brief:
    """Of a diagnosis alone."""
    return _brief(Course(d, (d,) if d.explains else (), d), _next(d))


def of_loop(found: Loop, *, sized: bool = True) -> Brief:
    """Of a closed loop: what all rounds came to, with the sizes of what is probable or without."""
    course = replace(course_of(found), sampled=found.rounds[-1].before.run)
    following = _next(course.last)
    before, after = found.rounds[0].before, found.rounds[-1].after
    if course.added and course.last.verdict == "adequate":
        following = _use(before, after)
    elif any(r.changed for r in found.rounds) and course.last.explains:
        following = f"Run the loop on from {spoken(course.last.hypothesis)}: it stopped before the end."
    return _brief(course, following, sized)


def course_of(found: Loop) -> Course:
    """The diagnoses of a loop."""
    every = [r.diagnosis for r in found.rounds]
    return Course(every[0], tuple(r.diagnosis for r in found.rounds if r.changed or r.diagnosis.explains), every[-1])


def _brief(course: Course, following: str, sized: bool = True) -> Brief:
    """As much as there is room for; ``sized`` is False where sizes are told elsewhere."""
    of = _ANSWERS[course.telling.verdict]
    for detail in DETAILS:
        c = replace(course, detail=detail if sized else replace(detail, sized=0))
        brief = Brief(tested(c.first), _probabilities(c), of(c), left(c), following)
        if brief.fits:
            break
    return brief


# ---- what was tested -------------------------------------------------------------------------------------------------


def tested(d: Diagnosis) -> str:
    """``film (reconstructed): 700 readings, 3 cycles to 30 mm, against Yeoh.``"""
    m, how = d.measurement, seen(d.measurement)
    origin = "" if how.origin == MEASURED else f" ({how.origin}, not measured)"
    what = "readings" if how.origin == MEASURED else "points"
    cycles = np.unique(m.cycle).size
    of = f" in {cycles} cycles" if cycles > 1 else " of a loop" if np.any(m.leg < 0) else ""
    of = of if m.rig.has_path else ""
    aside = "" if d.set_aside is None else f" ({len(d.set_aside.numbers)} set aside)"
    readings = f"{len(m)} {what}{aside}{of} to {how.place(float(np.max(m.deflection)))}"
    model = "" if d.declared else ", the nearest of all energies"
    return f"{m.specimen.name}{origin}: {readings}, against {spoken(d.null.hypothesis)}{model}."


# ---- the answer ------------------------------------------------------------------------------------------------------


def _probabilities(course: Course) -> tuple[str, ...]:
    """``98 % friction in the guide (level 12 mN)``, ``1 % no effect``: what each round named, then the last answer."""
    earlier = [_added(x, course) for x in course.before]
    first, *others = _every(course)
    return *earlier, f"then {first}" if earlier else first, *others


def _every(course: Course) -> list[str]:
    d = course.telling
    p = d.probabilities
    room = max(1, course.detail.told - bool(d.verdict == "ambiguous" and course.detail.sums and _in_all(d)))
    what, foreign = max(foreign_told(p), key=lambda told: told[1], default=("", 0.0))
    strange = bool(what) and sum(q > foreign for q in p.effects.values()) < room
    probable = [name for name, q in p.effects.items() if q >= WORDS.probable][: max(1, room - strange)]
    sizes = np.cumsum([len(name.split("+")) for name in probable])
    told = [_probable_set(d, n, course, bool(k <= course.detail.sized)) for n, k in zip(probable, sizes, strict=True)]
    if strange:
        told.insert(0 if foreign > 0.5 else len(told), f"{percent(foreign)} {what}")
    if d.verdict == "material":
        told.append(f"{percent(p.energies.get(d.material, 0.0))} the energy {d.best.hypothesis.material.title}")
    return told


def _added(d: Diagnosis, course: Course) -> str:
    """What a round added with its probability: the set that it named, or what is firm."""
    if d.explains:
        return _probable_set(d, set_name(d.best, d.null.names), course, course.detail.sized > 0)
    of = d.members[0].candidate if course.detail.sized > 0 else None
    return f"{percent(d.probabilities.of_effect(*d.firm))} {_with_sizes(d, '+'.join(d.firm), course, of)}"


def _probable_set(d: Diagnosis, name: str, course: Course, sized: bool) -> str:
    """A set of effects with its probability; where the answer rests on it with the sizes."""
    of = next((j.candidate for j in d.members if set_name(j.candidate, d.null.names) == name), None)
    return f"{percent(d.probabilities.effects.get(name, 0.0))} {_with_sizes(d, name, course, of if sized else None)}"


def _with_sizes(d: Diagnosis, name: str, course: Course, of: Candidate | None) -> str:
    """Effects with their sizes as they were fitted last: by the loop, or in this candidate; without one their names."""
    if of is None or name == NOTHING:
        return set_title(name)
    if course.last is not d and set(name.split("+")) <= set(course.last.null.names):
        of = settled(course.last.null, course.sampled)
    own = [e for e in of.hypothesis.effects if e.name in name.split("+")]
    return listed(f"{e.title} ({flagged_size(e, of, d.measurement)})" for e in own)


def _adequate(course: Course) -> str:
    name = spoken(course.telling.null.hypothesis)
    return f"{name} describes the curve" if course.telling.detection.adequate else f"{name} needs no effect"


def _named(course: Course) -> str:
    d, null, best = course.telling, course.first.null.hypothesis, course.telling.best
    if course.last is d and d.detection.adequate:
        return _improbable(d)
    best = best if course.last is d else course.last.null
    count = len(best.names) - len(null.effects)
    who, verb = ("it", "explains") if count == 1 else ("both" if count == 2 else "together they", "explain")
    other = f", with {_energy(best)}," if best.hypothesis.material is not null.material or _bound(best) else ""
    much = "the curve" if len(course.added) > 1 else f"{_explained(d)} of what {spoken(null)} misses"
    return f"{who} {verb}{other} {much}{_beside(d)}"


def _material(course: Course) -> str:
    d = course.telling
    if d.detection.adequate:
        return _improbable(d)
    return f"{_energy(d.best)} explains {_explained(d)} of what {spoken(d.null.hypothesis)} misses"


def _improbable(d: Diagnosis) -> str:
    return f"{spoken(d.null.hypothesis)} follows the curve, but by less probable parameters{_beside(d)}"


def _ambiguous(course: Course) -> str:
    d = course.telling
    sure, among = _certain(d), _in_all(d) if course.detail.sums else ""
    open_yet = "this curve cannot tell which" if len(d.members) > 1 else "another effect may be behind it"
    which = f"only {sure} nearly certain" if sure else f"{among}{open_yet}"
    first = "the first" if course.detail.told > 1 else "it"
    size = (
        ", yet at a size that is hardly met" if d.members and hardly_met(d.members[0].candidate, d.measurement) else ""
    )
    energy = f"{other}; " if (other := other_energy(d)) else ""
    rest = " of what is left" if course.before else ""
    return f"{energy}{which}; {first} explains {_explained(d)}{rest}{size}{_beside(d)}"


def _in_all(d: Diagnosis) -> str:
    """``in all relaxation 68 %, yet``: effects more probable than not, where sets with others add to their own."""
    p = d.probabilities
    if _certain(d):
        return ""
    likely = [n for n in p.likely() if p.of_effect(n) > p.effects.get(n, 0.0) + TELLING]
    each = [f"{effect_title(n)} {percent(p.of_effect(n))}" for n in likely]
    return f"in all {listed(each)}, yet " if each else ""


def _unknown(course: Course) -> str:
    d = course.telling
    sure, further = _certain(d), " further" if course.before else ""
    start = f"{sure} nearly certain, yet " if sure else ""
    if (strange := _strange(d)) is not None:
        beside = listed(effect_title(n) for n in strange.base.names)
        beside = f", beside {beside}" if beside and not sure else ""
        return f"{start}{foreign_clause(strange, d.rig, d.thickness)}{beside}"
    if d.members:
        return f"{start if d.firm else ''}nothing{further} is named, for {why_not(d)}"
    if d.probabilities.effects.get(NOTHING, 0.0) >= 0.5:
        return f"{start}none of the energies has this form"
    if far := why_none(d):
        return f"{start}nothing{further} is named, for {far}"
    return f"{start}too many explanations fit, and nothing{further} is named"


def _beside(d: Diagnosis) -> str:
    """What is foreign beside the effects, if that is more probable than not."""
    strange = _strange(d)
    return "" if strange is None else f", beside {foreign_clause(strange, d.rig, d.thickness)}"


def _strange(d: Diagnosis) -> Foreign | None:
    """What is foreign, where that is more probable than that nothing is."""
    return d.foreign if d.probabilities.something_found > 0.5 else None


def _certain(d: Diagnosis) -> str:
    """``friction is``: of effects in all that is probable; "" if there is none, or nothing else is probable anyway."""
    sure = nearly_certain(d)
    if not sure or d.probabilities.effects.get("+".join(sure), 0.0) >= VERDICT.sure:
        return ""
    return f"{listed(map(effect_title, sure))} {'is' if len(sure) == 1 else 'are'}"


_ANSWERS = {
    "adequate": _adequate,
    "named": _named,
    "material": _material,
    "ambiguous": _ambiguous,
    "unknown": _unknown,
}


def _explained(d: Diagnosis) -> str:
    share = d.remaining.share
    if 0.0 < share <= 1.0 - WORDS.all_of_it:
        return "nearly all"
    return "all" if share == 0.0 else language.percent(1.0 - share)


def _energy(candidate: Candidate) -> str:
    """The energy, with what lies at its bound."""
    return candidate.hypothesis.material.title + (f" ({bound})" if (bound := _bound(candidate)) else "")


# ---- what is left ----------------------------------------------------------------------------------------------------


def left(course: Course) -> str:
    """How much the answer leaves, where, and of what kind, as a clause: as the last diagnosis has it."""
    d = course.last
    if noise_alone(d):
        return "leaving noise alone"
    error, residual = (d.after, d.best.residual) if d.verdict in ANSWERED else (d.before, d.null.residual)
    place = where(residual_shape(d.measurement, residual)) if course.detail.places else ""
    much = f"leaving {error.rmse_N / d.noise.sd:.2g} times the noise{f', mostly {place}' if place else ''}"
    return f"{much}, {_kind(d, course.detail.places)}"


def noise_alone(d: Diagnosis) -> bool:
    """True if what the answer leaves is noise."""
    r = d.remaining
    if d.verdict == "adequate" and d.detection.adequate:
        return True
    return d.verdict != "unknown" and r.noise


def _kind(d: Diagnosis, each: bool) -> str:
    """What it looks like; whether ``each`` law is told that would have to be in error."""
    r = d.remaining
    if r.carried < VERDICT.form_carries:
        return "of no known kind"
    laws = laws_off(r.law_errors, WORDS.law_error)
    if laws and not each:
        return "smooth as errors of the laws would be"
    return f"smooth as if {listed([f'the energy were {100 * r.energy_error:.2g} %', *laws])} off"


def where(shape: ResidualShape) -> str:
    """``on unloading in the lower third``; "" if it is everywhere."""
    words = []
    up, down = shape.loading or 0.0, shape.unloading or 0.0
    if min(up, down) > 0 and max(up, down) > WORDS.uneven * min(up, down):
        words.append(f"on {'loading' if up > down else 'unloading'}")
    sizes = [size for _, size in shape.cycles]
    if len(sizes) > 1 and max(sizes) > WORDS.uneven * np.median(sizes):
        words.append(f"in cycle {shape.cycles[int(np.argmax(sizes))][0]}")
    filled = [s for s in shape.thirds if s > 0]
    if len(filled) > 1 and max(filled) > WORDS.uneven * min(filled):
        words.append(f"in the {PARTS[int(np.argmax(shape.thirds))]} third")
    return " ".join(words)


# ---- what to do next -------------------------------------------------------------------------------------------------


def _next(d: Diagnosis) -> str:
    if d.verdict == "adequate":
        return _use_as_it_is(d)
    if d.verdict == "unknown":
        return _when_unknown(d)
    if d.verdict == "ambiguous":
        return _tell_apart(d)
    v, name = d.validation, spoken(d.best.hypothesis)
    if v is not None and v.chosen != d.best.hypothesis.label():
        return f"Repeat the test: without {_held(d)} another model would have been chosen."
    if d.verdict == "material":
        return f"Calibrate {name}, or show by another test that {d.null.hypothesis.material.title} is right."
    return f"Calibrate with it in the model: {name}."


def _held(d: Diagnosis) -> str:
    return "the points held out" if d.validation is None or d.validation.cycles == 1 else "the last cycle"


def _use_as_it_is(d: Diagnosis) -> str:
    start = f"Use {spoken(d.null.hypothesis)} over this range"
    sizes = smallest_sizes(d)[:2]
    if d.detection.adequate and not sizes and d.power:
        return "Measure again with less noise, or more readings: this test could not have shown any effect."
    if not d.detection.adequate or not sizes:
        return f"{start}."
    seen_from = listed(f"{title} of {size}" for title, size in sizes)
    return f"{start}: {seen_from} would have shown."


def _when_unknown(d: Diagnosis) -> str:
    strange = _strange(d)
    if strange is None and d.experiments and d.experiments[0].separation >= NEXT_TEST.helps:
        return _tell_apart(d)
    if strange is None:
        return "Repeat the test, and do not extrapolate with this model."
    return ADVICE.get(strange.kind, "Repeat the test: what comes again is no accident.")


def _tell_apart(d: Diagnosis) -> str:
    best = next(iter(d.experiments), None)
    if len(d.members) == 1:
        return "Repeat the test in another motion: another effect may be behind what this one explains."
    if best is None or best.separation < NEXT_TEST.helps:
        return "No further test that was simulated tells them apart: rely on what holds for each of them."
    if best.separation < NEXT_TEST.clear:
        return f"What helps most: {spoken_test(best.test, d.rig)}."
    apart = f" ({best.separation:.2g} standard deviations apart)" if best.separation < FAR_APART else ""
    return f"To tell them apart: {spoken_test(best.test, d.rig)}{apart}."


def _use(before: Stage, after: Stage) -> str:
    """Which modulus to use."""
    (new, sd), (old, was_sure) = modulus_of(after.run), modulus_of(before.run)
    instead = "as without" if abs(new - old) <= MATTERS * was_sure else f"not {old:.4g}"
    return f"Use {spoken(after.run.hypothesis)}: shear modulus {new:.4g} +- {sd:.2g} MPa, {instead}."
