"""The forward model: exact slopes, scaling, and convexity over the whole measured range."""

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.registry import materials
from bayesmembrane.physics.convexity import MODES
from bayesmembrane.physics.forward import GAPS, Forward, beyond
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import Curves, Request, request, solve
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from tests.physics.predicting import predict

RIG = Annulus(0.012, 0.030)
CURVE = Measurement(np.linspace(2e-3, 40e-3, 8), np.linspace(0.1, 2, 8), RIG, Specimen("film", 5e-5))
FILMS = {
    "neo_hookean": [7.5],
    "mooney_rivlin": [6.2, 0.4],
    "gent": [5.3, 40.0],
    "yeoh": [8.0, -0.2, 0.03],
    "ogden": [11.0, 0.2, -0.4, 1.5, 4.8, -1.2],
}


def film(name: str) -> list[float]:
    """A usual film where none is named."""
    return FILMS.get(name, list(materials()[name].typical()))


def coordinates(name: str) -> np.ndarray:
    return np.append(materials()[name].to_coordinates(film(name)), -4.0)


@pytest.mark.parametrize("name", materials())
def test_slopes_are_those_of_the_force(name: str) -> None:
    h, x = hypothesis(name), coordinates(name)
    p = predict(h, x, CURVE, sensitivities=True)
    assert p.sensitivity is not None
    assert p.sensitivity.shape == (1, len(CURVE), h.curve_size)
    for i in range(h.curve_size):
        step = np.zeros(x.size)
        h_i = step[i] = 3e-3 * float(h.parameters[i].prior.distribution().std())
        f = predict(h, np.stack([x + step, x - step, x + 2 * step, x - 2 * step]), CURVE).force
        numeric = (8 * (f[0] - f[1]) - (f[2] - f[3])) / (12 * h_i)
        scale = np.max(np.abs(p.sensitivity[0, :, i]))
        assert np.max(np.abs(numeric - p.sensitivity[0, :, i])) < 2e-6 * scale + 1e-9 * np.max(p.force)


@pytest.mark.parametrize("name", materials())
def test_forward_is_the_solver(name: str) -> None:
    p = predict(hypothesis(name), coordinates(name), CURVE)
    direct = solve(request(materials()[name], film(name), CURVE.deflection, inner_radius=0.012, outer_radius=0.030))
    assert p.force == pytest.approx(direct.force, rel=1e-9)
    assert np.all(p.ok)


def test_one_modulus_is_solved_once() -> None:
    calls = []

    def counting(asked: Request) -> Curves:
        calls.append(asked)
        return solve(asked)

    forward = Forward(hypothesis("neo_hookean"), CURVE, CURVE.deflection, counting)
    x = np.linspace(1.0, 4.0, 50)[:, None]
    force = np.concatenate([forward(x).force, forward(x[::-1], sensitivities=True).force[::-1]])
    assert len(calls) <= 2
    direct = solve(
        request(materials()["neo_hookean"], 0.5 * np.exp(x), CURVE.deflection, inner_radius=0.012, outer_radius=0.030)
    ).force
    assert force == pytest.approx(np.concatenate([direct, direct]), rel=1e-9)


def test_a_truncated_fit_answers_for_the_whole_range() -> None:
    """Convex up to 15 mm, but not up to 40 mm: the margin is that of the whole curve, the force that of the part."""
    h, x = hypothesis("mooney_rivlin"), np.append(materials()["mooney_rivlin"].to_coordinates([3.0, 4.0]), -4.0)
    part = CURVE.up_to(15e-3)
    assert len(part) < len(CURVE)
    cut, whole = predict(h, x, part), predict(h, x, CURVE)
    alone = Forward(h, part, part.deflection)(x, reached=False)
    assert cut.force.shape == (1, len(part))
    assert cut.force == pytest.approx(whole.force[:, : len(part)], rel=1e-9)
    assert alone.convexity > 0 > whole.convexity
    assert cut.convexity == pytest.approx(whole.convexity, rel=0.02)


def test_helpers_leave_no_gap() -> None:
    for d, end in ((np.array([0.03, 0.01]), 0.1), (np.array([0.1]), 0.1), (np.linspace(0.01, 0.1, 40), 0.1)):
        extra = beyond(d, end)
        every = np.sort(np.concatenate([[0.0], d, extra]))
        assert every[-1] == end
        assert np.max(np.diff(every)) <= end / GAPS * (1 + 1e-9)
        assert not set(extra) & set(d)


def test_locked_films_say_so() -> None:
    p = predict(hypothesis("gent"), materials()["gent"].to_coordinates([5.0, 2.0]), CURVE)
    assert not p.ok[0]
    assert np.isnan(p.force[0, -1])
    assert np.isfinite(p.force[0, 0])


def test_every_mode_has_a_margin() -> None:
    h = hypothesis("yeoh")
    p = predict(h, coordinates("yeoh"), CURVE)
    margin = {n: m.margin(p, h.material)[0] for n, m in MODES.items()}
    assert margin["none"] == np.inf
    assert margin["reached"] <= margin["elliptic"] + 1e-12
    assert np.isfinite(margin["box"])


def test_another_rig_is_refused() -> None:
    m = Measurement(np.array([0.01, 0.02]), np.array([1.0, 2.0]), RIG, Specimen("film", 5e-5))
    object.__setattr__(m, "rig", type("Strip", (), {"name": "uniaxial"})())
    with pytest.raises(SettingsError, match='"uniaxial"'):
        predict(hypothesis("yeoh"), coordinates("yeoh"), m)


def test_films_without_effects_are_computed_in_batches_that_fit_into_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same forces, whatever the size of a batch."""
    d = np.linspace(0.001, 0.05, 300)
    m = Measurement(d, d, Uniaxial(), Specimen("strip", 1e-3))
    films = np.linspace(1.0, 2.0, 7)[:, None] * np.array([[150.0, 20.0]])
    whole = Forward(hypothesis("mooney_rivlin"), m, d).film_force(films)
    sizes, law = [], Forward.law

    def counted(self: Forward, part: np.ndarray, *rest: object) -> object:
        sizes.append(len(part))
        return law(self, part, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr("bayesmembrane.physics.forward.AT_ONCE", 700)
    monkeypatch.setattr(Forward, "law", counted)
    assert np.array_equal(Forward(hypothesis("mooney_rivlin"), m, d).film_force(films), whole)
    assert sizes == [2, 2, 2, 1]
