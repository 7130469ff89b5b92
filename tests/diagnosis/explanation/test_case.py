"""A case is the same whatever energy was declared: which effects can be seen in a test, above all."""

import numpy as np

from bayesmembrane.diagnosis.explanation.case import OpenCase, Question, opened
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import api
from tests.diagnosis.curves import measured

DEFLECTION = np.linspace(0.001, 0.030, 40)


def case(energy: str, declared: bool = True) -> OpenCase:
    """One loading of a neo-Hookean film, with this energy declared, or put in the place of one that is not."""
    blank = measured(np.ones(DEFLECTION.size), DEFLECTION)
    force = Forward(hypothesis("neo_hookean"), blank, DEFLECTION)(np.array([[np.log(5.0)]]), reached=False).force[0]
    noise = np.random.default_rng(5).normal(0, 0.003 * np.max(force), force.size)
    question = Question(hypothesis(energy), declared)
    return opened(measured(force + noise, DEFLECTION), question, 0, api.solve, lambda _: None)


def test_effects_that_a_flexible_energy_would_hide_are_visible_none_the_less() -> None:
    flexible, stiff = case("ogden"), case("neo_hookean")
    hidden = {e.name for e in stiff.visible} - {s.effect for s in flexible.signatures}
    assert hidden, "nothing is hidden by an Ogden film here: another curve is needed"
    assert hidden <= flexible.elsewhere
    assert [e.name for e in flexible.visible] == [e.name for e in stiff.visible]


def test_without_a_declared_energy_it_does_not_matter_which_one_stands_in_its_place() -> None:
    one, other = case("ogden", declared=False), case("neo_hookean", declared=False)
    assert list(one.plain) == list(other.plain)
    assert [c.log_evidence for c in one.plain.values()] == [c.log_evidence for c in other.plain.values()]
    assert one.null.label == other.null.label
