"""A posterior that knows a form error: what it is made of, what an emulator may ask it, and what its bands hold."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.predictions import Wanted, predict_draws
from bayesmembrane.calibration.run import Run, RunSettings, sample
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.form_error import MIXED, MOST_MIXED, form_factors
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus
from tests.generator.datasets import Dataset, generate


def cyclic(points: int = 40) -> Measurement:
    d = np.interp(np.linspace(0.02, 4, points), [0, 1, 2, 3, 4], [0, 0.02, 0.0, 0.04, 0.001])
    time = np.arange(1.0, points + 1)
    return Measurement(d, 60 * d, Annulus(0.010, 0.035), Specimen("film", 50e-6), time=time)


def draws(count: int = 4) -> tuple[Posterior, Array]:
    posterior = Posterior(hypothesis("neo_hookean", ["friction", "force_offset"], "form"), cyclic())
    rng = np.random.default_rng(3)
    x = np.column_stack([np.full(count, p.prior.quantile(0.6)) for p in posterior.hypothesis.parameters])
    return posterior, x + 0.05 * rng.standard_normal(x.shape) * np.abs(x)


def test_the_likelihood_is_the_normal_density_of_noise_energy_and_laws() -> None:
    """Sigma = tau^2 1 + (eta_a^2 + m^2) D_F K_u D_F + eta_e^2 D_t K_v D_t + (eta_l F_max)^2 P, t that of friction.

    An offset has none; P has ones at starts, turns, stops and slack ends.
    """
    posterior, x = draws()
    m, k = posterior.measurement, posterior.hypothesis.curve_size
    found, factors = posterior.evaluate(x), form_factors(m)
    plain = Posterior(hypothesis("neo_hookean", ["force_offset"]), m)
    own = [0, *(i for i, name in enumerate(posterior.hypothesis.names) if name.startswith("force_offset."))]
    without = plain.forward(x[:, own], reached=False).force
    for b in range(len(x)):
        tau, eta, at_turns, law = np.exp(x[b, k:]) * [np.max(m.force), 1, np.max(found.force[b]), 1]
        trace = found.force[b] - without[b]
        mix = min(MIXED * np.linalg.norm(trace) / np.linalg.norm(found.force[b]), MOST_MIXED)
        u = np.hypot(eta, mix) * found.force[b, :, None] * factors.state
        v = law * trace[:, None] * factors.progress
        sigma = tau**2 * np.eye(len(m)) + u @ u.T + v @ v.T + at_turns**2 * factors.local @ factors.local.T
        expected = multivariate_normal(found.force[b], sigma).logpdf(m.force)
        assert found.log_likelihood[b] == pytest.approx(expected, rel=1e-6)


def test_what_an_emulator_asks_is_the_posterior_at_the_true_curves() -> None:
    posterior, x = draws()
    e = posterior.evaluate(x)
    assert e.curves.shape == (len(x), 3 * len(posterior.measurement))
    assert posterior.given(e.curves, x) == pytest.approx(e.log_posterior)
    plain = Posterior(hypothesis("neo_hookean"), posterior.measurement)
    found = plain.evaluate(x[:, [0, -4]])
    assert plain.given(found.curves, x[:, [0, -4]]) == pytest.approx(found.log_posterior)


# ---- an energy that is not in the library ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def foreign() -> tuple[Dataset, Measurement]:
    """A film whose chains lock, declared as neo-Hookean: 40 of its readings, and what they were without noise."""
    data = generate("family:arruda_boyce", "neo_hookean", "single", seed=4, strength=2.0)
    d = 1e-3 * data.deflection_mm
    rig = Annulus(data.film.inner, data.film.outer)
    whole = Measurement(d[1:], data.force_N[1:], rig, Specimen("film", 50e-6), time=data.time_s[1:])
    return data, replace(whole.select(np.arange(8, len(whole), 9)), motion=None, places=None)


def sampled(noise: str, m: Measurement) -> Run:
    return sample(m, hypothesis("neo_hookean", noise=noise), RunSettings(seed=2, ess=300))


def held(run: Run, truth: Array) -> float:
    """The part of the points whose force without noise lies in the 90 % interval."""
    low, high = np.quantile(run.curves(), (0.05, 0.95), axis=0)
    return float(np.mean((low <= truth) & (truth <= high)))


def test_the_band_of_a_wrong_energy_holds_the_force_with_a_form_error_and_not_without(foreign) -> None:  # type: ignore[no-untyped-def]
    data, m = foreign
    truth = data.film.force(m.deflection)
    white, form = sampled("white", m), sampled("form", m)
    assert held(white, truth) < 0.5
    assert held(form, truth) > 0.8
    assert white.quality.smooth
    assert not form.quality.smooth
    # Beyond the readings the form error widens the band, and at them it does not.
    bands = [predict_draws(r.hypothesis, m, r.draws(), Wanted(up_to=0.055)) for r in (white, form)]
    wide = [np.subtract(*b.curve[[2, 0]]) / b.curve[1] for b in bands]
    assert wide[1][-1] > 3 * wide[1][~bands[1].beyond][-1]
    assert wide[1][-1] > wide[0][-1]
