"""What is asked of a solver is broadcast once, and refused in a sentence if it makes no sense."""

from __future__ import annotations

import numpy as np
import pytest

from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.physics.materials.gent import Gent
from bayesmembrane.physics.materials.mooney_rivlin import MooneyRivlin
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
from bayesmembrane.physics.mechanics import force_curve, request, solve
from bayesmembrane.physics.mechanics.request import extensibility


def test_shapes_are_broadcast():
    one = request(NeoHookean, [7.5], 0.01, 0.01, 0.035)
    assert (one.parameters.shape, one.deflection.shape, one.prestretch.shape) == ((1, 1), (1, 1), (1,))
    many = request(MooneyRivlin, np.ones((4, 2)), [0.01, 0.02, 0.03], 0.01, 0.035, prestretch=1.1)
    assert (many.deflection.shape, many.prestretch.shape) == ((4, 3), (4,))
    own = request(MooneyRivlin, np.ones((2, 2)), [[0.01], [0.02]], 0.01, 0.035, prestretch=[1.0, 1.1])
    assert own.deflection.tolist() == [[0.01], [0.02]]


def test_scaling_is_by_the_stress_free_inner_radius():
    asked = request(NeoHookean, [7.5], [-0.02, 0.0], 0.01, 0.035, prestretch=1.25)
    assert asked.scaled.tolist() == [[2.5, 0.0]]
    assert asked.ratio == pytest.approx(3.5)


def test_extensibility_is_infinite_but_for_limited_chains():
    assert extensibility(request(NeoHookean, [[7.5]] * 3, 0.01, 0.01, 0.035)).tolist() == [np.inf] * 3
    assert extensibility(request(Gent, [[5.0, 17.0], [5.0, 2.0]], 0.01, 0.01, 0.035)).tolist() == [17.0, 2.0]


GOOD = {"deflection": [0.01, 0.02], "inner_radius": 0.01, "outer_radius": 0.035, "prestretch": 1.0}
BAD = [
    ({"deflection": [0.01, np.nan]}, "deflection is not a finite number"),
    ({"deflection": [[0.01], [0.02], [0.03]]}, "deflections have the shape"),
    ({"inner_radius": 0.035, "outer_radius": 0.01}, "inner radius"),
    ({"inner_radius": 0.0}, "inner radius"),
    ({"inner_radius": -0.01}, "inner radius"),
    ({"outer_radius": np.nan}, "inner radius"),
    ({"outer_radius": np.inf}, "inner radius"),
    ({"prestretch": 0.0}, "pre-stretch"),
    ({"prestretch": np.nan}, "pre-stretch"),
    ({"prestretch": [1.0, 1.1, 1.2]}, "pre-stretches"),
]


@pytest.mark.parametrize(("change", "words"), BAD)
def test_questions_without_sense_are_refused_in_a_sentence(change, words):
    with pytest.raises(SettingsError) as fault:
        solve(request(MooneyRivlin, [[6.0, 1.5], [6.0, 1.4]], **{**GOOD, **change}))
    assert words in str(fault.value)
    assert str(fault.value).endswith(".")


def test_wrong_number_of_parameters_is_refused_with_their_names():
    with pytest.raises(SettingsError, match="mooney_rivlin takes 2 parameters \\(c1, c2\\), not 3"):
        solve(request(MooneyRivlin, [1.0, 2.0, 3.0], **GOOD))


def test_parameters_that_are_no_numbers_give_a_status_and_no_force():
    curves = solve(request(MooneyRivlin, [[np.nan, 1.0], [6.0, 1.5]], **GOOD))
    assert not curves.ok[0].any()
    assert curves.ok[1].all()


def test_unknown_names_suggest_the_nearest():
    with pytest.raises(SettingsError, match='did you mean "shooting"'):
        solve(request(MooneyRivlin, [6.0, 1.5], solver="shoting", **GOOD))
    with pytest.raises(SettingsError, match='did you mean "neo_hookean"'):
        force_curve("neohookean", [7.5], [0.01])


@pytest.mark.parametrize(("films", "deflection"), [([7.5], []), (np.empty((0, 1)), [0.01])])
def test_asking_for_nothing_is_refused(films, deflection):
    with pytest.raises(SettingsError, match="no film or no deflection"):
        solve(request(NeoHookean, films, deflection, 0.01, 0.035))
