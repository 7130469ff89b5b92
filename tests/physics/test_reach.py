"""Priors and bounds of effects' sizes are parts of what the test reached, on whatever rig."""

from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.calibration.objective import Objective
from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.effects.base import Effect
from bayesmembrane.physics.effects.clamp_slip import ClampSlip
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.reach import SOURCE, Reach, reach_of
from bayesmembrane.physics.rigs.uniaxial import Uniaxial

EFFECTS = {name: cls() for name, cls in components("effects").items()}
every = pytest.mark.parametrize("effect", EFFECTS.values(), ids=EFFECTS)
LARGE = Reach(1.2, 300.0, 7.0)
PARTS = np.linspace(0.05, 0.95, 7)


def strip(scale: float = 1e5) -> Measurement:
    """A strip that is pulled to three times its length; forces are stresses in Pa."""
    d = np.linspace(0.05, 2.0, 40)
    return Measurement(d, scale * d, Uniaxial(), Specimen("strip", 1e-3), time=d)


@every
def test_sizes_are_as_large_a_part_of_any_test(effect: Effect) -> None:
    for p, there in zip(effect.coordinates, effect.on(LARGE).coordinates, strict=True):
        small, large = (r.duration if p.of_the_test else r.by_unit.get(p.unit, 1.0) for r in (SOURCE, LARGE))
        assert there.prior.quantile(PARTS) / large == pytest.approx(p.prior.quantile(PARTS) / small, rel=1e-12)
        assert np.array(there.bounds) / large == pytest.approx(np.array(p.bounds) / small, rel=1e-12)
        assert there.null == p.null
        assert there.one_sided == p.one_sided
        if p.unit in ("-", "s") and not p.of_the_test:
            assert there == p


@every
def test_where_it_was_before_does_not_matter(effect: Effect) -> None:
    assert effect.on(LARGE).on(SOURCE).coordinates == effect.coordinates
    assert effect.on(LARGE).on(LARGE) == effect.on(LARGE)
    assert effect.on(LARGE) != effect.on(SOURCE)


def test_a_zero_of_stresses_is_expected_in_parts_of_the_stress() -> None:
    m = strip()
    h = hypothesis("gent", ["force_offset"])
    offset = {p.name: p for p in Posterior(h, m).prior.hypothesis.parameters}["force_offset.offset"]
    assert offset.prior.mean_sd[1] == pytest.approx(np.max(m.force) * 0.03 / SOURCE.force)
    assert offset.bounds[1] > 0.1 * np.max(m.force)


@pytest.mark.parametrize("make", [Posterior, lambda h, m: Objective(h, m, "euclidean", api.solve)])
def test_whoever_holds_a_measurement_has_its_priors(make) -> None:  # type: ignore[no-untyped-def]
    m, h = strip(), hypothesis("gent", ["machine_compliance", "force_drift"])
    assert make(h, m).hypothesis == h.on(m) != h
    there = h.on(m)
    assert make(there, m).hypothesis is there  # whoever keeps something by its identity finds it again


def test_a_longer_and_stronger_test_reaches_more() -> None:
    m = strip()
    assert reach_of(m) == Reach(2.0, float(np.max(m.force)), float(m.path.clock[-1]), False)
    assert reach_of(replace(m, force=-m.force)) == reach_of(m)
    assert reach_of(m.up_to(1.0)).travel == 2.0
    assert reach_of(replace(m, force=0 * m.force)).force == SOURCE.force


def test_what_comes_at_a_moment_may_come_until_the_last_reading() -> None:
    """Where the first reading is not at rest, too: the clock runs from rest on."""
    d = np.linspace(0.7, 2.0, 27)
    begun = Measurement(d, 1e5 * d, Uniaxial(), Specimen("strip", 1e-3), time=d)
    (tear,) = hypothesis("gent", ["tearing"]).on(begun).effects
    (moment,) = (p for p in tear.coordinates if p.name == "moment")
    assert moment.bounds == (0.0, pytest.approx(2.0))


def test_a_plain_film_is_the_same_in_any_test() -> None:
    h = hypothesis("yeoh")
    assert h.on(strip()) is h


def test_slip_is_felt_alike_at_any_stretch_where_no_clamp_holds_the_film_all_round() -> None:
    (effect,) = hypothesis("gent", ["clamp_slip"]).on(strip()).effects
    eased, declared = (next(p for p in c if p.name == "eased") for c in (effect.coordinates, ClampSlip.coordinates))
    assert eased.prior.mean_sd[1] < 0.1 * declared.prior.mean_sd[1]
    assert eased.first == pytest.approx(0.0)
    assert max(map(abs, eased.bounds)) < 0.05  # a fit without a prior keeps to bounds alone
