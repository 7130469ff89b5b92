"""Verdicts follow from probabilities: of the effects, and of what is foreign beside them."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from bayesmembrane.diagnosis.candidates.candidate import Candidate, with_effects
from bayesmembrane.diagnosis.explanation import verdict as verdicts
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.explanation.case import OpenCase
from bayesmembrane.diagnosis.explanation.foreign import SUDDEN, Foreign
from bayesmembrane.diagnosis.explanation.telling import NOTHING
from bayesmembrane.diagnosis.explanation.total import Judged, Probabilities, Total
from bayesmembrane.diagnosis.explanation.verdict import decided
from bayesmembrane.diagnosis.thresholds import VERDICT
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.hypothesis import hypothesis


def candidate(effects: str, energy_error: float = 1e-3, material: str = "gent") -> Candidate:
    """A fit of a set of effects, with no residual to speak of."""
    names = [] if effects == NOTHING else effects.split("+")
    claim = with_effects(hypothesis(material), [components("effects")[n]() for n in names])
    theta = np.array([0.0, np.log(energy_error), *([np.log(0.05)] * len(names))])
    nothing = np.zeros(3)
    return Candidate(
        claim, np.zeros(claim.curve_size), nothing, nothing[:, None], 0.0, (), nothing[None], theta, nothing
    )


def total(
    sets: dict[str, float],
    strange: float = 0.0,
    takes: float = 0.5,
    left: float = 0.01,
    best: Candidate | None = None,
    by_laws: dict[str, float] | None = None,
) -> Total:
    """A sum over sets of effects, with something sudden beside the first of the probability ``strange``, which takes
    the part ``takes`` of the part ``left`` of the squares that the effects leave. ``by_laws`` : sets before some of it
    was told of others; as ``sets`` by itself.
    """
    chosen = {name: best if best is not None and i == 0 else candidate(name) for i, name in enumerate(sets)}
    ranking = tuple(Judged(chosen[n], p, 0.0, 1.0 if n == NOTHING else left, 1.0) for n, p in sets.items())
    kinds = {SUDDEN: strange, NOTHING: 1 - strange}
    first = next(iter(sets))
    joint = {(n, k): p * q for n, p in sets.items() for k, q in kinds.items() if q > 0}
    foreign = Foreign(SUDDEN, chosen[first], 30.0, size=0.1, place=5, share=takes)
    return Total(
        ranking,
        Probabilities(sets, {"gent": 1.0}, dict(sorted(kinds.items(), key=lambda i: -i[1]))),
        dict(sorted(joint.items(), key=lambda i: -i[1])),
        sets if by_laws is None else by_laws,
        (foreign,) if strange else (),
    )


def verdict(
    sets: dict[str, float], null: str = "gent", describes: bool = True, unseen: bool = False, **more: Any
) -> tuple[str, list[str], bool]:
    tested = SimpleNamespace(adequate=describes)
    case = SimpleNamespace(null=candidate(NOTHING, material=null), tested=lambda _: tested, sees_nothing=unseen)
    found = decided(cast(OpenCase, case), total(sets, **more))
    return found.verdict, ["+".join(m.candidate.names) for m in found.members], found.foreign is not None


def test_a_set_is_named_from_the_probability_on_that_is_asked_for() -> None:
    assert verdict({"friction": 0.951, "mullins": 0.049}) == ("named", ["friction"], False)
    assert verdict({"friction": 0.949, "mullins": 0.051}) == ("ambiguous", ["friction", "mullins"], False)


def test_an_ambiguous_answer_holds_the_fewest_sets_that_are_enough() -> None:
    assert verdict({"friction": 0.6, "mullins": 0.36, "tearing": 0.04})[1] == ["friction", "mullins"]


def test_an_answer_has_as_many_sets_as_the_laws_ask_for_and_the_most_probable_ones() -> None:
    laws, told = {"friction": 0.6, NOTHING: 0.36, "mullins": 0.04}, {NOTHING: 0.37, "friction": 0.36, "mullins": 0.27}
    assert verdict(told, by_laws=laws)[:2] == ("ambiguous", ["", "friction"])


def test_what_is_told_for_being_next_to_another_set_is_no_member() -> None:
    """By the laws it is refuted: a clamp that slips left 55 in reduced chi-square beside a film that relaxes."""
    laws = {"viscoelastic": 0.91, "viscoelastic+zero_offset": 0.05, "clamp_slip": 1e-20}
    told = {"viscoelastic": 0.85, "clamp_slip": 0.1, "viscoelastic+zero_offset": 0.05}
    assert verdict(told, by_laws=laws)[:2] == ("ambiguous", ["viscoelastic", "viscoelastic+zero_offset"])


def test_more_sets_than_can_be_told_are_rivals_that_a_further_test_would_have_to_tell_apart() -> None:
    names = ["friction", "mullins", "tearing", "clamp_slip", "zero_offset", "prestretch", "force_drift", "viscoelastic"]
    case = cast(OpenCase, SimpleNamespace(null=candidate(NOTHING), sees_nothing=False))
    crowd = decided(case, total(dict.fromkeys(names, 1 / len(names))))
    assert (crowd.verdict, crowd.members) == ("unknown", ())
    assert ["+".join(j.candidate.names) for j in crowd.rivals] == names[: VERDICT.most_members]
    few = decided(case, total({"friction": 0.6, "mullins": 0.4}))
    assert few.rivals == few.members
    assert decided(case, total({"friction": 0.96, "mullins": 0.04})).rivals == ()


@pytest.mark.parametrize(("told", "named"), [(0.951, "named"), (0.949, "ambiguous"), (0.6, "ambiguous")])
def test_a_set_that_is_sure_by_the_laws_alone_gets_no_name(told: float, named: str) -> None:
    """And what is next to impossible does not stand beside it; the rest is told of sets that nobody fitted."""
    laws = {"friction": 1 - 1e-9, "mullins": 1e-9}
    assert verdict({"friction": told, "mullins": 0.005}, by_laws=laws)[:2] == (named, ["friction"])


def test_where_no_test_sees_a_misfit_nothing_is_missing_unless_that_is_doubted() -> None:
    """The same whether single effects were weighed by their traces, or all of them by fits."""
    assert verdict({NOTHING: 0.88, "friction": 0.12}, unseen=True) == ("adequate", [""], False)
    assert verdict({NOTHING: 0.88, "friction": 0.12})[0] == "ambiguous"
    assert verdict({NOTHING: 0.78, "friction": 0.22}, unseen=True)[0] == "ambiguous"
    assert verdict({NOTHING: 0.88, "friction": 0.12}, unseen=True, strange=0.3)[0] != "adequate"


def unfitted(found: Total, *names: str) -> Total:
    """The same sum, in which these sets have their probability by their traces alone."""
    return replace(found, ranking=tuple(j for j in found.ranking if "+".join(j.candidate.names) not in names))


def test_a_set_is_not_named_for_its_rivals_having_never_been_fitted() -> None:
    case = cast(OpenCase, SimpleNamespace(null=candidate(NOTHING), sees_nothing=False))
    sets = {"friction": 0.90, "mullins": 0.07, "tearing": 0.02, "clamp_slip": 0.01}
    found = decided(case, unfitted(total(sets), "mullins"))
    assert found.verdict == "ambiguous"
    assert [m.candidate.names for m in found.members] == [("friction",), ("tearing",)]
    assert decided(case, unfitted(total({"friction": 0.96, "mullins": 0.04}), "mullins")).verdict == "named"


@pytest.mark.parametrize(("then", "answer"), [(0.97, "named"), (0.80, "ambiguous")])
def test_sets_that_share_an_answer_with_one_that_was_fitted_are_fitted(
    monkeypatch: pytest.MonkeyPatch, then: float, answer: str
) -> None:
    sets = {"friction": 0.90, "mullins": 0.07, "friction+mullins": 0.02, "tearing": 0.01}
    before = unfitted(total(sets), "mullins", "friction+mullins")
    sums = [before, total({"friction": then, "mullins": 1 - then})]
    fitted: list[list[frozenset[str]]] = []
    monkeypatch.setattr(verdicts, "grown", lambda _: SimpleNamespace(search=None))
    monkeypatch.setattr(verdicts, "summed", lambda _: sums.pop(0))
    monkeypatch.setattr(verdicts, "with_sets", lambda _, names: fitted.append(names))
    monkeypatch.setattr(verdicts, "with_falls", lambda _, falls: bool(falls))
    _, found = verdicts.explained(cast(OpenCase, SimpleNamespace(null=candidate(NOTHING), sees_nothing=False)))
    assert fitted == [[frozenset({"mullins"})]]
    assert (found.verdict, sums) == (answer, [])


def test_falls_of_the_force_that_are_worth_a_word_are_looked_at_once_more(monkeypatch: pytest.MonkeyPatch) -> None:
    fall = replace(total({"mullins": 1.0}, strange=0.9), foreign=())
    falls = [Foreign(SUDDEN, candidate("mullins"), 30.0, size=s) for s in (-0.1, 0.1)]
    said = replace(fall, foreign=tuple(falls))
    sums, asked = [said, total({"mullins+tearing": 0.97, "mullins": 0.03})], list[list[Foreign]]()
    monkeypatch.setattr(verdicts, "grown", lambda _: SimpleNamespace(search=None))
    monkeypatch.setattr(verdicts, "summed", lambda _: sums.pop(0))
    monkeypatch.setattr(verdicts, "with_falls", lambda _, found: asked.append(found) or True)
    _, found = verdicts.explained(cast(OpenCase, SimpleNamespace(null=candidate(NOTHING), sees_nothing=False)))
    assert asked == [falls[:1]]
    assert [m.candidate.names for m in found.members] == [("mullins", "tearing")]
    faint = replace(said, probabilities=total({"mullins": 1.0}, strange=0.01).probabilities)
    assert verdicts._falls(faint) == []


def test_too_many_sets_are_no_answer() -> None:
    names = ["friction", "mullins", "tearing", "clamp_slip", "viscoelastic", "hysteresis", "force_drift"]
    assert verdict(dict.fromkeys(names, 1 / 7))[0] == "unknown"
    assert verdict({"friction": 0.3, **dict.fromkeys(names[1:], 0.7 / 6)})[0] == "unknown"
    found = verdict({"friction": 0.36, **dict.fromkeys(names[1:], 0.64 / 6)})
    assert found[0] == "ambiguous"  # a test that decides on friction is worth making
    few = {"friction": 0.25, "mullins": 0.25, "tearing": 0.2, **dict.fromkeys(names[3:], 0.3 / 4)}
    assert verdict(few)[0] == "ambiguous"  # three of them hold three fifths
    assert verdict({NOTHING: 0.36, **dict.fromkeys(names[1:], 0.64 / 6)})[0] == "ambiguous"
    assert verdict({NOTHING: 0.30, **dict.fromkeys(names[1:], 0.70 / 6)})[0] == "unknown"
    assert found[1][0] == "friction"


def test_what_is_foreign_and_small_is_told_beside_a_name() -> None:
    assert verdict({"friction": 0.99, "mullins": 0.01}, strange=0.99, left=0.05) == ("named", ["friction"], True)


def test_what_is_foreign_and_large_forbids_a_name() -> None:
    assert verdict({"friction": 0.99, "mullins": 0.01}, strange=0.99, left=0.5) == ("unknown", [], True)


def test_what_is_foreign_without_any_effect_is_no_name() -> None:
    assert verdict({NOTHING: 0.99, "friction": 0.01}, strange=0.99) == ("unknown", [], True)
    assert verdict({NOTHING: 0.7, "friction": 0.3}, strange=0.99) == ("unknown", [], True)
    assert verdict({NOTHING: 0.92, "friction": 0.08}, strange=0.92, takes=0.1) == ("unknown", [], True)


@pytest.mark.parametrize(("null", "answer"), [("gent", "adequate"), ("yeoh", "material")])
def test_no_effect_is_adequate_or_another_energy(null: str, answer: str) -> None:
    assert verdict({NOTHING: 0.99, "friction": 0.01}, null=null)[0] == answer


def test_an_energy_that_is_far_off_is_not_known() -> None:
    poor = candidate(NOTHING, energy_error=0.2)
    assert verdict({NOTHING: 1.0}, describes=False, best=poor)[0] == "unknown"
    assert verdict({"friction": 1.0}, best=candidate("friction", energy_error=0.2))[0] == "unknown"


@pytest.mark.parametrize(("yeoh", "error", "chosen"), [(0.4, 1e-3, "yeoh"), (0.1, 1e-3, "ogden"), (0.4, 0.2, "ogden")])
def test_of_energies_as_good_the_one_with_fewest_parameters_stands_for_a_set(
    yeoh: float, error: float, chosen: str
) -> None:
    """It need not be the first, but its form may not be what explains the curve."""
    both = ("ogden", 0.96 - yeoh, 1e-3), ("yeoh", yeoh, error)
    ranking = tuple(Judged(candidate("friction", e, m), p, 0.0, 0.01, 1.0) for m, p, e in both)
    case = SimpleNamespace(null=candidate(NOTHING), sees_nothing=False)
    found = decided(cast(OpenCase, case), replace(total({"friction": 0.96, "mullins": 0.04}), ranking=ranking))
    assert [m.candidate.hypothesis.material.name for m in found.members] == [chosen]
    assert found.ranking == ranking


def test_an_effect_beside_one_energy_is_a_rival_of_another_energy_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """An energy with many parameters may follow an effect wholly; a simpler one with the effect is as good."""
    plain = {n: replace(candidate(NOTHING, material=n), log_evidence=z) for n, z in (("ogden", 0.0), ("yeoh", -15.0))}
    drift = SimpleNamespace(name="force_drift", odds=1.0)
    promised = {"ogden": -50.0, "yeoh": 20.0}
    monkeypatch.setattr(verdicts, "promised", lambda _, base, __: promised[base.hypothesis.material.name])
    search = SimpleNamespace(excess=lambda _: 0.0)
    case = SimpleNamespace(
        null=plain["ogden"],
        best_plain=plain["ogden"],
        plain=plain,
        visible=[drift],
        search=search,
        question=SimpleNamespace(energy=None),
        tell=lambda _: None,
        foreign=lambda *_: [],
    )
    p = verdicts.adequate(cast(OpenCase, case)).probabilities
    odds = float(np.exp(5.0 + BELIEFS.log_set((1.0,), (1.0,)) - BELIEFS.log_set((), (1.0,))))
    assert p.effects["force_drift"] / p.effects[NOTHING] == pytest.approx(odds, rel=0.02)
    assert p.energies["yeoh"] / p.energies["ogden"] == pytest.approx(odds**BELIEFS.energies_flatter, rel=0.02)
