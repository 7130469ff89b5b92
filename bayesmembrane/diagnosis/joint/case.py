"""The case of several tests of one material: all energies fitted to all of them, the model tested on all together."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from scipy.linalg import block_diag

from bayesmembrane.diagnosis.candidates.candidate import Candidate, hidden
from bayesmembrane.diagnosis.candidates.sampled import checked
from bayesmembrane.diagnosis.candidates.signatures import signatures
from bayesmembrane.diagnosis.candidates.speeds import one_speed
from bayesmembrane.diagnosis.candidates.weighing import Weighing
from bayesmembrane.diagnosis.detection.detect import Detection
from bayesmembrane.diagnosis.detection.lack_of_fit import lack_of_fit
from bayesmembrane.diagnosis.detection.scores import Signature, score_test
from bayesmembrane.diagnosis.explanation.case import DiagnosisCase, OpenCase, Question, Tell, renewed, seen_elsewhere
from bayesmembrane.diagnosis.explanation.foreign import Foreign
from bayesmembrane.diagnosis.explanation.foreign_search import OneTest, beside
from bayesmembrane.diagnosis.explanation.twins import Near, Pairs, twins, twins_in_time, twins_one_way
from bayesmembrane.diagnosis.joint.effects import EffectInTests, effects_in_tests
from bayesmembrane.diagnosis.joint.search import JointSearch, joint_noise
from bayesmembrane.diagnosis.reference.noise import Whitened, whitened
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.effects.base import AT, Effect
from bayesmembrane.physics.hypothesis import Hypothesis


@dataclass(frozen=True, eq=False)
class JointCase(DiagnosisCase):
    """The case of several tests.

    search : as the case began; its noise is that of every test alone
    alone : the case of every test
    labels : what the tests are called
    """

    search: JointSearch
    alone: tuple[OpenCase, ...]
    labels: tuple[str, ...]

    @cached_property
    def sees_nothing(self) -> bool:
        """True if no test sees a misfit: of all measurements together, nor of each alone."""
        return all(c.detection.adequate for c in self.alone) and super().sees_nothing

    def detected(self, white: Whitened, found: Sequence[Signature]) -> Detection:
        return Detection(lack_of_fit(white), score_test(white, found, self.rng), None)

    def renewed(self, search: Weighing, best: Candidate) -> JointSearch:
        assert isinstance(search, JointSearch)
        parts = []
        for part, case, rows in zip(search.parts, self.alone, search.rows, strict=True):
            keep = np.zeros(search.force.size, dtype=bool)
            keep[rows] = True
            parts.append(renewed(part, case.smooth, best.at(keep)))
        return replace(search, parts=tuple(parts), noise=joint_noise([p.noise for p in parts]))

    def twins(self) -> Pairs:
        """Those that no test tells apart, and no two of another speed: of the material in all, of a rig in that one.

        Of twins of which one is of the material and the other of a rig, in the tests that both are at work in.
        """
        out: dict[frozenset[str], Near] = dict(twins(self.effects, self.signatures))
        names = {u.name: u for u in self.effects if isinstance(u, EffectInTests)}
        in_time = [twins_in_time(c.effects, c.measurement) for c in self.alone]
        one_way = [twins_one_way(c.effects, c.measurement) for c in self.alone]
        by_nature = [twins(c.effects, ()) for c in self.alone]
        for each, any_speed in ((in_time, False), (one_way, True), (by_nature, True)):
            for i, pairs in enumerate(each):
                for pair, near in pairs.items():
                    own = [n for n in names if n.partition(AT)[0] in pair and names[n].within(i) is not None]
                    where = {t for n in own for t in names[n].places}
                    speed = any_speed or one_speed(*(self.alone[t].measurement for t in where))
                    if len(own) == 2 and speed and all(pair in each[t] for t in where):
                        out[frozenset(own)] = near
        return out

    def log_evidence_of_limit(self, search: Weighing, bases: Sequence[Candidate]) -> float:
        """No test speaks for the others: what is foreign in one of them is looked for when all is known."""
        return -np.inf

    def foreign(self, search: Weighing, bases: Sequence[Candidate], others: Sequence[Candidate]) -> list[Foreign]:
        """What is foreign in one of the tests."""
        assert isinstance(search, JointSearch)
        found: list[Foreign] = []
        for i, label in enumerate(self.labels):
            found += [replace(f, test=i, label=label) for f in beside(one_test(search, i), bases, others)]
        return sorted(found, key=lambda f: -(f.gain + f.base.log_evidence))


def one_test(search: JointSearch, number: int) -> OneTest:
    """Where something foreign in one of the tests is looked for."""
    part, rows = search.parts[number], search.rows[number]
    return OneTest(search, part, rows, partial(search.with_noise, number), partial(search.restricted, test=number))


def opened_jointly(alone: Sequence[OpenCase], labels: Sequence[str], question: Question, tell: Tell) -> JointCase:
    """Every energy fitted to all tests, from where each of them alone was, and the null model tested.

    The effects of ``question`` are at work in every test where they can occur; those of the cases have them, too.
    Raises `SettingsError` if no film of any energy reaches the ends of all tests.
    """
    thickness = [c.measurement.specimen.thickness for c in alone]
    parts = tuple(c.search for c in alone)
    noise = joint_noise([p.noise for p in parts])
    search = JointSearch(parts, tuple(t / min(thickness) for t in thickness), noise)
    one_clock = len({c.measurement.time is None for c in alone}) == 1
    given = effects_in_tests([{e.name: e for e in c.question.hypothesis.effects} for c in alone], labels, one_clock)
    shown = {e.name for c in alone for e in c.effects}
    effects = tuple(effects_in_tests([_possible(c, shown) for c in alone], labels, one_clock))
    smooth = np.asarray(block_diag(*(c.smooth for c in alone)))
    rng = np.random.default_rng([alone[0].search.seed, 8])
    plain = {n: checked(search, c) for n, c in _energies(search, alone, question, given, tell).items()}
    best = max(plain.values(), key=lambda c: c.log_evidence)
    declared = question.hypothesis.material.name
    if question.declared and declared not in plain:
        raise SettingsError(f"no {declared} film reaches the data of all tests", remedy="use another material")
    null = plain[declared] if question.declared else best
    tell("testing the residuals of all tests")
    found = signatures(search, null, effects)
    elsewhere = seen_elsewhere(search, plain, effects, {s.effect for s in found})
    white = whitened(null.residual, null.slopes, smooth, noise.cautious())
    detection = Detection(lack_of_fit(white), score_test(white, found, rng), None)
    return JointCase(
        question,
        search,
        smooth,
        plain,
        null,
        effects,
        tuple(found),
        elsewhere,
        detection,
        rng,
        tell,
        tuple(alone),
        tuple(labels),
    )


def _possible(case: OpenCase, shown: Collection[str]) -> dict[str, Effect]:
    """Effects that could be at work in one of several tests: those, too, that its own film would absorb alone.

    What only its motion hides counts if another test shows it (``shown``), or if it is a constant of the material.
    """
    further = hidden(case.measurement, case.question.hypothesis)
    return {e.name: e for e in (*case.effects, *(e for e in further if e.absorbed or e.constant or e.name in shown))}


def _energies(
    search: JointSearch, alone: Sequence[OpenCase], question: Question, given: Sequence[EffectInTests], tell: Tell
) -> dict[str, Candidate]:
    """Every energy that reaches all tests, with the given effects."""
    found = {}
    for name in [n for n in alone[0].plain if all(n in c.plain for c in alone)]:
        kind = alone[0].plain[name].hypothesis.material
        claim = Hypothesis(kind, tuple(given), question.hypothesis.noise, question.hypothesis.convexity)
        tell(f"fitting {kind.title} to all tests")
        candidate = search.fit(claim, [*_starts(search, claim, [c.plain[name] for c in alone])])
        if candidate is not None:
            found[name] = candidate
    if not found:
        raise SettingsError("no film of any energy reaches the data of all tests", remedy="use shorter ranges")
    return found


def _starts(search: JointSearch, claim: Hypothesis, alone: Sequence[Candidate]) -> list[Array]:
    """The energy as each test alone has it, with the effects as each has its own; then draws of the prior."""
    n, out = claim.material_size, []
    for i, own in enumerate(alone):
        x = np.concatenate([own.x[:n], *([p.first for p in u.coordinates] for u in claim.effects)])
        x[0] -= np.log(search.thicker[i])
        for j, there in sorted(enumerate(alone), key=lambda other: other[0] == i):  # constants are those of this test
            x[search.places(claim, j)[n:]] = there.x[n:]
        out.append(x)
    return [*out, *search.material_starts(claim)]
