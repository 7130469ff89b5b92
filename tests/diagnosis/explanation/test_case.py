"""A case is the same whatever energy was declared: which effects can be seen in a test, above all."""

import numpy as np

from bayesmembrane.diagnosis.explanation.case import OpenCase, Question, opened
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import api
from tests.diagnosis.curves import measured

DEFLECTION = np.linspace(0.001, 0.030, 40)


def case(energy: str) -> OpenCase:
    """One loading of a neo-Hookean film, with this energy declared."""
    blank = measured(np.ones(DEFLECTION.size), DEFLECTION)
    force = Forward(hypothesis("neo_hookean"), blank, DEFLECTION)(np.array([[np.log(5.0)]]), reached=False).force[0]
    noise = np.random.default_rng(5).normal(0, 0.003 * np.max(force), force.size)
    return opened(measured(force + noise, DEFLECTION), Question(hypothesis(energy)), 0, api.solve, lambda _: None)


def test_effects_that_a_flexible_energy_would_hide_are_visible_none_the_less() -> None:
    flexible, stiff = case("ogden"), case("neo_hookean")
    hidden = {e.name for e in stiff.visible} - {s.effect for s in flexible.signatures}
    assert hidden, "nothing is hidden by an Ogden film here: another curve is needed"
    assert hidden <= flexible.elsewhere
    assert [e.name for e in flexible.visible] == [e.name for e in stiff.visible]
