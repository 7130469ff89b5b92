"""Published constants: the paper's initial parameters, and what the priors make of its tables."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from bayesmembrane.physics.materials.arruda_boyce import ArrudaBoyce
from bayesmembrane.physics.materials.exp_ln import ExpLn
from bayesmembrane.physics.materials.gent import Gent
from bayesmembrane.physics.materials.gent_thomas import GentThomas
from bayesmembrane.physics.materials.lopez_pamies import LopezPamies
from bayesmembrane.physics.materials.mooney_rivlin import MooneyRivlin
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
from bayesmembrane.physics.materials.ogden import Ogden
from bayesmembrane.physics.materials.yeoh import Yeoh

MPA, D = 1e6, 50e-6


@pytest.mark.parametrize(
    ("material", "constants", "membrane"),
    [
        (NeoHookean, [0.15 * MPA], [7.5]),
        (MooneyRivlin, [0.14 * MPA, 0.01 * MPA], [7.0, 0.5]),
        (Gent, [0.3 * MPA / 2, 50.0], [7.5, 50.0]),
        (Yeoh, [0.15 * MPA, -0.0015 * MPA, 0.000015 * MPA], [7.5, -0.075, 0.00075]),
        (Ogden, [0.618 * MPA, 0.0012 * MPA, -0.01 * MPA, 1.3, 5.0, -2.0], [30.9, 0.06, -0.5, 1.3, 5.0, -2.0]),
    ],
)
def test_the_papers_initial_parameters_at_50_um(material, constants, membrane):
    film = material.from_3d(constants, D)
    np.testing.assert_allclose(film.vector, membrane, rtol=1e-12)
    if material is not Ogden:
        assert film.shear_modulus(film.vector) == pytest.approx(15.0)


@pytest.mark.parametrize(
    ("material", "p"),
    [
        (NeoHookean, [7.6191]),
        (NeoHookean, [13.245621]),
        (MooneyRivlin, [6.21436, 1.4703426]),
        (MooneyRivlin, [13.459625, -0.1179734]),
        (Gent, [7.6059127, 523.01]),
        (Gent, [5.312, 17.42]),
        (Yeoh, [8.821764, -0.65316385, 0.06163691]),
        (Yeoh, [8.840838, -0.6303258, 0.05632747]),
        (Yeoh, [0.173146, -0.00074, 0.000034]),
        (Yeoh, [0.24162, 0.19977, -0.00541]),
        (Ogden, [30.9, 0.06, -0.5, 1.3, 5.0, -2.0]),
        (Ogden, [27.999382, 0.03160439, -0.48299527, 1.1806412, 4.9906154, -1.9481684]),
        (Ogden, [11.060008, 0.1959017, -0.3679535, 1.5196142, 5.805068, -1.1529809]),
        # Treloar's rubber at 50 um; Arruda and Boyce 1993.
        (ArrudaBoyce, [13.5, 26.5]),
    ],
)
def test_published_films_lie_inside_the_prior(material, p):
    x = material.to_coordinates(p)
    for value, c in list(zip(x, material.coordinates, strict=True))[1:]:
        assert abs(value - c.prior.mean) <= 2.1 * c.prior.sd, c.name
        assert c.bounds[0] < value < c.bounds[1]


def test_gent_approaches_neo_hooke_when_the_limit_goes_away():
    l1, l2 = np.array([1.1, 2.0, 3.0]), np.array([1.0, 1.5, 2.5])
    for got, expected in zip(Gent(7.5, 1e12)._at(l1, l2), NeoHookean(7.5)._at(l1, l2), strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-8)


def test_ogden_with_exponents_2_and_minus_2_is_mooney_rivlin():
    l1, l2 = np.array([1.1, 2.0, 3.0]), np.array([1.0, 1.5, 2.5])
    ogden = Ogden(2 * 5.0, 2 * 1.0, -2 * 1.0, 2.0, 2.0, -2.0)
    for got, expected in zip(ogden._at(l1, l2), MooneyRivlin(6.0, 1.0)._at(l1, l2), strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-11)


@pytest.mark.parametrize(
    "p",
    [
        [-0.48953, 0.73743, -0.60229, 1.30073, 2.95646, 1.35266],  # a term of negative stiffness
        [0.06, 30.9, -0.5, 5.0, 1.3, -2.0],  # terms exchanged
        [30.9, 0.06, 0.5, 1.3, 5.0, 2.0],  # no negative exponent
    ],
)
def test_ogden_outside_the_cone_has_an_energy_but_no_coordinates(p):
    assert np.isnan(Ogden.to_coordinates(p)).all()
    assert np.isfinite(Ogden.from_vector(p)._at(2.0, 1.5)).all()


def test_arruda_boyce_is_the_eight_chains_of_langevin_to_the_order_of_its_series():
    """dW/dI1 = c1 / (6 x) L^-1(x) with x = sqrt(I1 / (3 N)) and L(b) = coth b - 1 / b; the next term has x^10."""
    c1, links, stretch = 7.0, 200.0, 1.5
    slope = ArrudaBoyce(c1, links).tension(stretch, stretch)[0] / (2 * (stretch - stretch**-5))
    x = np.sqrt((2 * stretch**2 + stretch**-4) / (3 * links))
    langevin = brentq(lambda b: 1 / np.tanh(b) - 1 / b - x, 1e-3, 3.0, xtol=1e-15, rtol=1e-14)
    assert slope == pytest.approx(c1 / (6 * x) * langevin, rel=10 * x**10 + 1e-11)
    assert slope != pytest.approx(c1 / 2, rel=1e-3)


@pytest.mark.parametrize("links", [3.0, 26.5, 400.0])
def test_the_modulus_of_arruda_boyce_is_the_published_series(links):
    n = 1 / links
    series = 1 + 3 / 5 * n + 99 / 175 * n**2 + 513 / 875 * n**3 + 42039 / 67375 * n**4
    assert ArrudaBoyce(2.0, links).shear_modulus((2.0, links)) == pytest.approx(2 * series, rel=1e-12)


def test_gent_thomas_bends_its_mooney_plot():
    """P / (2 (l - l^-2)) = c1 + c2 / (l I2) of a strip: the reduced stress of the second term falls with l I2."""
    stretch = np.array([1.2, 2.0, 4.0])
    found = GentThomas(5.0, 3.0).tension(stretch, stretch**-0.5)[0] / (2 * (stretch - stretch**-2))
    np.testing.assert_allclose(found, 5.0 + 3.0 / (stretch * (2 * stretch + stretch**-2)), rtol=1e-12)


def test_exp_ln_stiffens_by_its_exponential_and_softens_by_its_logarithm():
    """P / (2 (l - l^-5)) = c1 (exp(a K) - b ln(1 + K)) of a film stretched both ways, K = 2 l^2 + l^-4 - 3."""
    stretch = np.array([1.1, 2.0, 4.0])
    k = 2 * stretch**2 + stretch**-4 - 3
    for b in (0.0, 0.2):
        found = ExpLn(5.0, 0.03, b).tension(stretch, stretch)[0] / (2 * (stretch - stretch**-5))
        np.testing.assert_allclose(found, 5.0 * (np.exp(0.03 * k) - b * np.log1p(k)), rtol=1e-12)


def test_the_published_film_of_lopez_pamies_lies_within_bounds():
    """VHB 4910 at 0.5 mm, 1.08 and 13.54 kPa: A. Kumar, O. Lopez-Pamies, C. R. Mecanique 344 (2016) 102."""
    film = LopezPamies.from_3d([1.08e3, 13.54e3, -2.474, 1.0], 5e-4)
    assert film.shear_modulus(film.vector) == pytest.approx(7.31)
    for value, c in zip(LopezPamies.to_coordinates(film.vector), LopezPamies.coordinates, strict=True):
        assert c.bounds[0] < value < c.bounds[1], c.name


def test_lopez_pamies_with_exponents_1_and_2_is_yeoh():
    """mu / 2 (I1 - 3) + mu / 12 (I1^2 - 9) = (c1 + c2) / 2 K + c2 / 12 K^2."""
    l1, l2 = np.array([1.1, 2.0, 3.0]), np.array([1.0, 1.5, 2.5])
    for got, expected in zip(LopezPamies(6.0, 1.2, 1.0, 2.0)._at(l1, l2), Yeoh(3.6, 0.1, 0.0)._at(l1, l2), strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-11)


@pytest.mark.parametrize("p", [[-1.0, 9.0, 0.5, 2.0], [9.0, 1.0, 2.0, 0.5]])
def test_lopez_pamies_outside_the_cone_has_an_energy_but_no_coordinates(p):
    assert np.isnan(LopezPamies.to_coordinates(p)).all()
    assert np.isfinite(LopezPamies.from_vector(p)._at(2.0, 1.5)).all()
