import numpy as np
import pytest

from bayesmembrane.diagnosis.candidates import Search, with_effects
from bayesmembrane.diagnosis.heldout import error_of, held_out, validate
from bayesmembrane.diagnosis.saturated import reference_basis
from bayesmembrane.diagnosis.whitening import own_noise
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
from tests.diagnosis.curves import SD, measured, triangle
from tests.generator.datasets import generate


def test_errors_of_known_residuals() -> None:
    e = error_of(np.array([3.0, -4.0, 0.0, 0.0]), np.full(4, 2.0), parameters=2)
    assert e.rmse_N == pytest.approx(2.5)
    assert e.max_N == 4
    assert e.reduced_chi2 == pytest.approx(25 / 4 / 2)
    assert error_of(np.ones(2), np.ones(2), parameters=9).reduced_chi2 == 2


def test_points_are_set_aside_by_the_path_alone() -> None:
    rng = np.random.default_rng(12)
    for peaks, cycle in (((0.02, 0.03, 0.04), 3), ((0.02, 0.04), 2)):
        d = triangle(120, peaks)
        masks = [held_out(measured(rng.standard_normal(120), d))[0] for _ in range(2)]
        assert np.array_equal(*masks)
        assert np.array_equal(masks[0], measured(np.zeros(120), d).cycle == cycle)
    mask, words = held_out(measured(np.zeros(100), np.linspace(0.001, 0.04, 100)))
    assert np.count_nonzero(mask) == 25
    assert not mask[0]
    assert not mask[-1]
    assert "block" in words


def test_too_few_points_set_nothing_aside() -> None:
    mask, words = held_out(measured(np.zeros(12), np.linspace(0.001, 0.04, 12)))
    assert not np.any(mask)
    assert "nothing" in words


def test_the_right_effect_predicts_the_cycle_that_it_has_not_seen() -> None:
    data = generate("force_drift", "neo_hookean", "staircase", seed=302)
    m = measured(data.force_N, 1e-3 * data.deflection_mm, data.time_s)
    mask, where = held_out(m)
    assert np.array_equal(mask, m.cycle == 5)
    search = Search(m, own_noise(m, reference_basis(m)))
    plain = Hypothesis(NeoHookean)
    drift, friction = (with_effects(plain, [components("effects")[n]()]) for n in ("force_drift", "friction"))
    fits = []
    for h in (plain, drift, friction):
        start = search.sane(plain)[0]
        fits.append(search.fit(h, [np.concatenate([start, *(e.typical for e in h.effects)])]))
    found = validate(search, mask, where, fits[0], fits[1], fits[2:])
    assert found.where == where
    assert found.chosen == fits[1].label
    assert found.after.rmse_N < 1.2 * SD < found.before.rmse_N
    assert found.covered_before < 0.8 < found.covered_after < 0.98
    # What was set aside decides nothing: other readings there leave the choice and the fits as they are.
    assert validate(search, np.zeros(len(m), dtype=bool), "nothing", *fits[:2], []) is None
