"""Effects in inference: the posterior of a film whose effect has vanished is that of the film, for every rig."""

from collections.abc import Callable

import numpy as np
import pytest

from bayesmembrane.calibration.fit import fit
from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.registry import components, materials
from bayesmembrane.physics.hypothesis import from_settings, hypothesis
from bayesmembrane.physics.rigs.base import Strip
from bayesmembrane.physics.rigs.uniaxial import Uniaxial

FILMS = {
    "neo_hookean": (7.5,),
    "mooney_rivlin": (6.2, 0.4),
    "gent": (5.3, 40.0),
    "yeoh": (8.0, -0.2, 0.03),
    "ogden": (11.0, 0.2, -0.4, 1.5, 4.8, -1.2),
}
Film = Callable[..., Measurement]


def coordinates(name: str, effects: tuple[str, ...] = ()) -> np.ndarray:
    h = hypothesis(name, effects)
    return np.concatenate([h.material.to_coordinates(FILMS[name]), *(e.null for e in h.effects), [-5.0]])


@pytest.mark.parametrize("name", FILMS)
def test_at_null_the_posterior_is_that_of_the_film(name: str, film: Film) -> None:
    """The film law is good to 1e-6 of the force, and the convexity prior looks at other states on the way."""
    m = film("yeoh", FILMS["yeoh"], points=16, noise=2e-3)
    effects = ("force_offset", "mullins", "machine_compliance")
    plain = Posterior(hypothesis(name), m).evaluate(coordinates(name))
    with_effects = Posterior(hypothesis(name, effects), m).evaluate(coordinates(name, effects))
    assert plain.outcome == with_effects.outcome
    assert with_effects.force == pytest.approx(plain.force, rel=2e-6, nan_ok=True)
    if np.isfinite(plain.log_likelihood[0]):
        assert with_effects.log_likelihood == pytest.approx(plain.log_likelihood, rel=1e-3)


def test_prior_draws_are_all_accounted_for(film: Film) -> None:
    m = film("yeoh", FILMS["yeoh"], points=80, noise=2e-3)
    names = tuple(n for n, e in components("effects").items() if not e().unavailable(m.rig, m.path))
    posterior = Posterior(hypothesis("mooney_rivlin", names), m)
    x = posterior.prior.draw(np.random.default_rng(2), 64)
    e = posterior.evaluate(x)
    assert np.all(np.isfinite(e.log_likelihood) == np.all(np.isfinite(e.force), axis=1))
    assert np.any(np.isfinite(e.log_posterior))
    x[:, 2 + [p.name for p in posterior.hypothesis.parameters][2:].index("clamp_slip.slip")] = -0.01
    assert np.all(posterior.evaluate(x).log_posterior == -np.inf)


def test_settings_come_back_with_effects() -> None:
    h = hypothesis("gent", ("mullins", "zero_offset"))
    assert from_settings(h.settings()) == h
    assert h.label() == "gent+mullins+zero_offset"
    assert len(h.natural_names) == len(h.natural_units) == len(h.names)


@pytest.mark.parametrize("kind", [k for k, r in components("rigs").items() if issubclass(r, Strip) and k != "biaxial"])
def test_a_strip_with_a_slipping_grip_is_fitted(kind: str) -> None:
    """The free length grows by 4 % of the largest stretch so far: another law of growth than the one fitted."""
    rig = components("rigs")[kind]()
    d = rig.length * np.concatenate(
        [np.linspace(0.02, 1.0, 40), np.linspace(0.98, 0.1, 40), np.linspace(0.12, 1.5, 60)]
    )
    longer = 1 + 0.04 * np.maximum.accumulate(d / rig.length) / 1.5
    stretch = np.maximum((1 + d / rig.length) / longer, 1.0)
    film = materials()["yeoh"](150.0, -1.0, 0.05)
    force = rig.width * film.tension(stretch, rig.lateral(stretch)[0])[0]
    force = force + 2e-3 * np.random.default_rng(1).standard_normal(d.size)
    m = Measurement(d, force, rig, Specimen("strip", 1e-3))
    found, plain = (fit(m, hypothesis("yeoh", e, convexity="none")) for e in (("clamp_slip",), ()))
    assert found.rmse_N < 2.4e-3 < plain.rmse_N
    assert found.parameters["clamp_slip.slip"].value == pytest.approx(0.04, rel=0.1)
    assert found.parameters["clamp_slip.exponent"].value == pytest.approx(1.0, abs=0.3)


def test_too_few_points_are_refused_with_effects() -> None:
    m = Measurement(np.array([0.01, 0.02, 0.03]), np.ones(3), Uniaxial(), Specimen("strip", 1e-3))
    from bayesmembrane.ground.errors import SettingsError

    claim = hypothesis("yeoh", ("zero_offset", "force_offset"))
    with pytest.raises(SettingsError, match="3 points cannot fix the 5 parameters of yeoh"):
        Posterior(claim, m)
    with pytest.raises(SettingsError, match="3 points cannot fix the 8 parameters of yeoh"):  # nothing holds shapes
        fit(m, claim)
