"""What every material must keep, run over all that the registry finds, third parties' included."""

from __future__ import annotations

import inspect
import pickle

import numba
import numpy as np
import pytest

from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.registry import materials
from bayesmembrane.physics.materials.base import LN_GD
from tests.physics.materials.films import draws, films, slopes

pytestmark = pytest.mark.parametrize("material", materials().values(), ids=materials().keys())


def test_everything_follows_from_its_energy(material):
    """Stresses, second derivatives and sensitivities are the derivatives of the first value, W, in 50 digits."""
    for p, l1, l2 in zip(*films(material, 10), strict=True):
        expected, rates = slopes(material, p, l1, l2)
        scale = np.abs(expected) + 1e-3 * np.abs(material.shear_modulus(p))
        np.testing.assert_array_less(np.abs(material.derivatives(p, l1, l2) - expected) / scale, 1e-11)
        wrong = np.abs(np.array(material.sensitivities(p, l1, l2)) - rates)
        np.testing.assert_allclose(wrong / (np.abs(rates) + 1e-4 * np.abs(rates).max(0)), 0, atol=1e-10)


def test_no_digits_are_lost_at_small_strain(material):
    """Energy and stresses fall with the square and with the strain; their relative accuracy must not."""
    for p, e1, e2 in zip(*films(material, 5, spread=(1.0, 1.001)), strict=True):
        l1, l2 = 1 + 1e-3 * (e1 - 1) + 1e-6, 1 + 1e-3 * (e2 - 1) + 1e-6
        expected, _ = slopes(material, p, l1, l2)
        np.testing.assert_allclose(material.derivatives(p, l1, l2), expected, rtol=1e-9)


def test_compiled_equals_plain(material):
    # No fused operations here: the same text must give the same numbers to the last bits.
    six, sens = numba.njit(material.derivatives), numba.njit(material.sensitivities)
    for p, l1, l2 in zip(*films(material, 20), strict=True):
        np.testing.assert_allclose(six(p, l1, l2), material.derivatives(p, l1, l2), rtol=1e-12, atol=1e-14 * p[0])
        np.testing.assert_allclose(sens(p, l1, l2), material.sensitivities(p, l1, l2), rtol=1e-11, atol=1e-13)


def test_broadcasts_over_films_and_points(material):
    p, l1, l2 = films(material, 5)
    grid = material.derivatives(p.T[:, :, None], l1[:, None], l2[:, None] * np.ones(3))
    for row in grid:
        assert np.shape(row) in ((5, 3), (5, 1))
    for i in range(5):
        one = [np.asarray(v)[i, 0] for v in grid]
        np.testing.assert_allclose(one, material.derivatives(p[i], l1[i], l2[i]), rtol=1e-13)


def test_isotropy(material):
    for p, l1, l2 in zip(*films(material, 20), strict=True):
        w, w1, w2, w11, w12, w22 = material.derivatives(p, l1, l2)
        mirror = material.derivatives(p, l2, l1)
        np.testing.assert_allclose((w, w2, w1, w22, w12, w11), mirror, rtol=1e-11)


def test_rest_is_free_of_energy_and_stress(material):
    for p in draws(material, 20):
        w, w1, w2, *_ = material.derivatives(p, 1.0, 1.0)
        assert (w, w1, w2) == (0.0, 0.0, 0.0)


def test_initial_stiffness_is_the_shear_modulus(material):
    for p in draws(material, 20):
        *_, w11, w12, w22 = material.derivatives(p, 1.0, 1.0)
        np.testing.assert_allclose((w11, 2 * w12, w22), 4 * material.shear_modulus(p), rtol=1e-12)


def test_scales_say_what_is_proportional_to_the_modulus(material):
    for p, l1, l2 in zip(*films(material, 10), strict=True):
        scaled = p * np.where(np.array(material.scales) == 1, 3.7, 1.0)
        expected = 3.7 * np.array(material.derivatives(p, l1, l2))
        np.testing.assert_allclose(material.derivatives(scaled, l1, l2), expected, rtol=1e-12)
        assert material.extensibility(scaled) == material.extensibility(p)


def test_does_not_exist_beyond_its_limit(material):
    p = draws(material, 20)
    limit = np.broadcast_to(material.extensibility(p.T), 20)
    compiled = numba.njit(material.derivatives)
    for q, k in zip(p[np.isfinite(limit)], limit[np.isfinite(limit)], strict=True):
        beyond = np.sqrt(k + 3.0)
        with np.errstate(invalid="ignore"):
            assert np.isnan(material.derivatives(q, beyond, beyond)).all()
            assert np.isnan(material.sensitivities(q, beyond, beyond)).all()
        assert np.isnan(compiled(q, beyond, beyond)).all()


def test_coordinates_round_trip(material):
    rng = np.random.default_rng(3)
    x = np.stack([c.prior.draw(rng, (7, 30)) for c in material.coordinates])
    p = material.from_coordinates(x)
    assert p.shape == (len(material.field_names()), 7, 30)
    np.testing.assert_allclose(material.to_coordinates(p), x, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(material.shear_modulus(p), np.exp(x[0]), rtol=1e-12)


def test_coordinates_are_declared(material):
    first, *_ = material.coordinates
    assert first == LN_GD
    assert len({c.name for c in material.coordinates}) == len(material.coordinates) == len(material.field_names())
    for c in material.coordinates:
        assert c.unit
        assert len(c.meaning) > 5
        low, high = c.prior.quantile([0.001, 0.999])
        assert c.bounds[0] < low < high < c.bounds[1], "an optimiser must be free to search where the prior lives"
        x = np.linspace(low, high, 20001)
        np.testing.assert_allclose(np.trapezoid(np.exp(c.prior.log_density(x)), x), 0.998, rtol=1e-4)


def test_no_modulus_no_coordinates(material):
    p = draws(material, 3).T
    p[np.array(material.scales) == 1] *= -1.0
    assert np.isnan(material.to_coordinates(p)[0]).all()


def test_3d_constants_round_trip(material):
    for p in draws(material, 5):
        film = material.from_vector(p)
        back = material.from_3d(film.to_3d(50e-6), 50e-6)
        np.testing.assert_allclose(back.vector, film.vector, rtol=1e-14)
        twice = material.from_3d(film.to_3d(50e-6), 100e-6)
        np.testing.assert_allclose(twice.shear_modulus(twice.vector), 2 * film.shear_modulus(film.vector), rtol=1e-14)


def test_pickles_and_compares(material):
    film = material.from_vector(draws(material, 1)[0])
    again = pickle.loads(pickle.dumps(film))
    assert again == film
    assert hash(again) == hash(film)
    np.testing.assert_array_equal(again.hessian(1.2, 1.1), film.hessian(1.2, 1.1))


def test_documents_itself(material):
    assert not inspect.isabstract(material)
    assert "W =" in inspect.getdoc(material)
    assert "G d" in inspect.getdoc(material)
    assert material.title
    assert any(c.isdigit() for c in material.reference), "a reference has a year"
    assert len(material.units) == len(material.meanings) == len(material.scales) == len(material.field_names())
    assert all(len(p.meaning) > 5 for p in material.natural_parameters())
    assert set(material.scales) <= {0, 1}
    for unit, scale in zip(material.units, material.scales, strict=True):
        assert unit == ("N/m" if scale else "-")


@pytest.mark.parametrize("bad", [[], [1.0] * 9, ["nan"]])
def test_wrong_parameters_are_refused_in_a_sentence(material, bad):
    values = [float("nan")] * len(material.field_names()) if bad == ["nan"] else bad
    with pytest.raises(SettingsError, match=r"parameters"):
        material.from_vector(values)


def test_the_neo_hookean_film_inside_is_one(material):
    """Within bounds, and with the tensions of the neo-Hookean energy, or next to them in a limit."""
    x = material.neo_hookean(15.0)
    if x is None:
        pytest.skip("contains no neo-Hookean film")
    low, high = np.array([p.bounds for p in material.coordinates]).T
    assert np.all((x >= low) & (x <= high))
    film, plain = material.from_vector(material.from_coordinates(x)), materials()["neo_hookean"](7.5)
    l1, l2 = np.meshgrid(np.linspace(1.0, 4.0, 9), np.linspace(1.0, 4.0, 9))
    np.testing.assert_allclose(film.tension(l1, l2), plain.tension(l1, l2), rtol=1e-5, atol=1e-9)


def test_what_is_convex_everywhere_is_so_in_every_state(material):
    """Also where the film is pressed, and close to the most curved state of K, l1 = l2 = 1.556."""
    rng = np.random.default_rng(21)
    x = np.stack([c.prior.draw(rng, 400) for c in material.coordinates])
    p = material.from_coordinates(x)
    sure = np.asarray(material.convex_everywhere(p))
    assert sure.shape == (400,)
    l1, l2 = np.exp(rng.normal(0.5, 0.7, (2, 500)))
    l1[:100], l2[:100] = rng.normal(1.556, 0.05, (2, 100))
    with np.errstate(all="ignore"):
        _, _, _, w11, w12, w22 = material.derivatives(p[:, sure][:, :, None], l1, l2)
        convex = (w11 > 0) & (w11 * w22 - w12**2 > 0)
    assert np.all(convex | np.isnan(w11))
