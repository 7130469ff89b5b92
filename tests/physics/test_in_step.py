"""Films that are solved together are those that are solved one by one."""

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.form_error import traces
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis
from bayesmembrane.physics.in_step import in_step, traces_in_step
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.mechanics.request import Request
from bayesmembrane.physics.mechanics.solution import Curves
from bayesmembrane.physics.rigs.annulus import Annulus
from tests.diagnosis.curves import triangle

PATH = triangle(60, (0.02, 0.03))
TEST = Measurement(
    PATH, 1e3 * PATH**2, Annulus(0.010, 0.035), Specimen("film", 5e-5), time=np.arange(1.0, PATH.size + 1)
)
CLAIMS = [
    ("yeoh", ()),
    ("yeoh", ("prestretch", "mullins")),
    ("gent", ("machine_compliance",)),
    ("yeoh", ("permanent_set",)),
    ("gent", ()),
]


def claim(material: str, effects: tuple[str, ...]) -> Hypothesis:
    plain = hypothesis(material)
    return Hypothesis(plain.material, tuple(components("effects")[n]() for n in effects))


def draws(h: Hypothesis, count: int) -> np.ndarray:
    middle = np.array([float(p.prior.quantile(0.5)) for p in h.parameters[: h.curve_size]])
    return middle + 0.01 * np.abs(middle) * np.arange(count)[:, None]


class Counted:
    """The solver, and how often it was asked for slopes."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, asked: Request) -> Curves:
        self.calls += asked.sensitivities
        return api.solve(asked)


@pytest.mark.parametrize("count", [1, 3])
def test_together_and_one_by_one_are_the_same(count: int) -> None:
    asked = [(Forward(claim(*c), TEST, TEST.deflection), draws(claim(*c), count)) for c in CLAIMS]
    for found, (forward, x) in zip(in_step(asked), asked, strict=True):
        alone = forward(x, sensitivities=True, reached=False)
        assert found.sensitivity is not None
        assert alone.sensitivity is not None
        np.testing.assert_array_equal(found.status, alone.status)
        np.testing.assert_allclose(found.force, alone.force, rtol=1e-9)
        scale = np.max(np.abs(alone.sensitivity), axis=1, keepdims=True)
        np.testing.assert_allclose(found.sensitivity / scale, alone.sensitivity / scale, atol=1e-7)


def test_one_energy_is_solved_once() -> None:
    effects = [("mullins",), ("permanent_set",), ("clamp_slip",)]
    apart, together = Counted(), Counted()
    for solve, run in ((apart, lambda pairs: [in_step([p]) for p in pairs]), (together, in_step)):
        run([(Forward(claim("yeoh", e), TEST, TEST.deflection, solve), draws(claim("yeoh", e), 1)) for e in effects])
    assert together.calls < apart.calls


def test_a_film_that_ends_does_not_touch_its_neighbours() -> None:
    whole, short = claim("gent", ("mullins",)), claim("gent", ("permanent_set",))
    x, locked = draws(whole, 1), draws(short, 1)
    limit = [p.name for p in short.parameters].index("gent.ln_jm")
    locked[:, limit] = short.parameters[limit].bounds[0]
    forwards = [Forward(h, TEST, TEST.deflection) for h in (whole, short)]
    found = in_step([(forwards[0], x), (forwards[1], locked)])
    assert not np.all(np.isfinite(found[1].force))
    np.testing.assert_allclose(found[0].force, forwards[0](x, reached=False).force, rtol=1e-9)


def test_traces_together_are_those_of_each_alone() -> None:
    asked = [(Forward(claim(*c), TEST, TEST.deflection), draws(claim(*c), 1)) for c in CLAIMS]
    forces = [forward(x, reached=False).force for forward, x in asked]
    found = traces_in_step([(f, x[0], force[0]) for (f, x), force in zip(asked, forces, strict=True)])
    for trace, (forward, x), force in zip(found, asked, forces, strict=True):
        np.testing.assert_allclose(
            trace, traces(forward, x, force, changing=True)[0], atol=1e-9 * float(np.max(np.abs(force)))
        )
    assert np.any(found[2])
    assert found[0].shape == (0, TEST.deflection.size)
