from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.diagnosis.candidates.candidate import with_effects
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.left.heldout import held_out, misfit_of, validate
from bayesmembrane.diagnosis.left.shape import residual_shape
from bayesmembrane.diagnosis.reference.inferred import own_noise
from bayesmembrane.diagnosis.reference.smooth import smooth_reference
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
from bayesmembrane.physics.rigs.biaxial import Biaxial
from bayesmembrane.words.diagnosis import set_aside
from tests.diagnosis.curves import SD, measured, triangle
from tests.generator.datasets import generate


def test_errors_of_known_residuals() -> None:
    e = misfit_of(np.array([3.0, -4.0, 0.0, 0.0]), np.full(4, 2.0), parameters=2)
    assert e.rmse_N == pytest.approx(2.5)
    assert e.max_N == 4
    assert e.reduced_chi2 == pytest.approx(25 / 4 / 2)
    assert misfit_of(np.ones(2), np.ones(2), parameters=9).reduced_chi2 == 2


def test_points_are_set_aside_by_the_path_alone() -> None:
    rng = np.random.default_rng(12)
    for peaks, cycle in (((0.02, 0.03, 0.04), 3), ((0.02, 0.04), 2)):
        d = triangle(120, peaks)
        masks = [held_out(measured(rng.standard_normal(120), d)) for _ in range(2)]
        assert np.array_equal(*masks)
        assert np.array_equal(masks[0], measured(np.zeros(120), d).cycle == cycle)
    mask = held_out(measured(np.zeros(100), np.linspace(0.001, 0.04, 100)))
    assert np.count_nonzero(mask) == 25
    assert not mask[0]
    assert not mask[-1]


def test_too_few_points_set_nothing_aside() -> None:
    assert not np.any(held_out(measured(np.zeros(12), np.linspace(0.001, 0.04, 12))))


def test_states_that_are_no_path_have_no_cycles_no_legs_and_no_noise_that_remembers() -> None:
    """A sheet pulled again and again, each time further across: one state after the other, in the order of a file."""
    l1 = np.tile(np.linspace(1.05, 1.5, 12), 8)
    l2 = 1 + np.repeat(np.linspace(0.1, 1.0, 8), 12) * (l1 - 1)
    x, across = 0.05 * (np.concatenate([l1, l2]) - 1), np.concatenate([l2, l1])
    # An error that goes on from reading to reading, as that of a wrong energy does along a series.
    force = 10 * x / 0.05 + np.sin(np.arange(x.size) / 4)
    m = Measurement(x, force, Biaxial(), Specimen("sheet", 1e-3), across=across)
    assert np.unique(m.cycle).size > 1
    noise = own_noise(m, np.column_stack([np.ones(x.size), x]))
    assert noise.rho == 0
    assert noise.sd == pytest.approx(np.sqrt(0.5), rel=0.05)
    shape = residual_shape(m, force)
    assert (shape.loading, shape.unloading, len(shape.cycles)) == (None, None, 1)
    assert 0.2 < np.mean(held_out(m)) < 0.3


def test_the_right_effect_predicts_the_cycle_that_it_has_not_seen() -> None:
    data = generate("force_drift", "neo_hookean", "staircase", seed=302)
    m = measured(data.force_N, 1e-3 * data.deflection_mm, data.time_s)
    assert np.array_equal(held_out(m), m.cycle == 5)
    search = Search(m, own_noise(m, smooth_reference(m)))
    plain = Hypothesis(NeoHookean)
    drift, friction = (with_effects(plain, [components("effects")[n]()]) for n in ("force_drift", "friction"))
    fits = []
    for h in (plain, drift, friction):
        start = search.material_starts(plain)[0]
        fits.append(search.fit(h, [np.concatenate([start, *(e.typical for e in h.effects)])]))
    found = validate(search, fits[0], fits[1], [(c, 0.0) for c in fits])
    assert (found.cycle, found.cycles) == (5, 5)
    assert set_aside(found) == "cycle 5"
    assert found.chosen == fits[1].label
    assert found.after.rmse_N < 1.2 * SD < found.before.rmse_N
    assert 0.8 < found.covered_after < 0.98
    few = m.select(np.arange(len(m)) < 12)
    assert validate(replace(search, measurement=few), *fits[:2], []) is None
