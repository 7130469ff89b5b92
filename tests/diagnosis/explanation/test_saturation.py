"""A load cell that yields: the law, its slopes, a softer one of another law that is found, a peak that is none."""

from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.evidence import weighed
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.explanation.saturation import Saturation, saturated
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import api
from tests.diagnosis.curves import SD, measured, triangle, white_noise

CLAIM = hypothesis("neo_hookean")
FORCE = np.linspace(-0.2, 2.0, 23)
LAW = Saturation(1.2, 40.0)


def test_small_forces_and_pushes_are_read_as_they_are_and_large_ones_at_the_limit() -> None:
    reading = LAW.reading(FORCE)
    np.testing.assert_allclose(reading[FORCE < 0.8], FORCE[FORCE < 0.8], rtol=1e-6)
    np.testing.assert_allclose(reading[FORCE > 1.5], 1.2, rtol=1e-4)
    assert np.all(np.diff(reading) > 0)
    assert np.all(reading <= np.minimum(FORCE, 1.2) + 1e-12)


def test_slopes_are_those_of_the_reading() -> None:
    h = 1e-6
    by_force = (LAW.reading(FORCE + h) - LAW.reading(FORCE - h)) / (2 * h)
    np.testing.assert_allclose(LAW.slope(FORCE), by_force, atol=1e-6)
    limits = (Saturation(1.2 * np.exp(s * h), 40.0).reading(FORCE) for s in (1, -1))
    np.testing.assert_allclose(LAW.by_limit(FORCE), np.subtract(*limits) / (2 * h), atol=1e-6)
    widths = (Saturation(1.2, 40.0 * np.exp(-s * h)).reading(FORCE) for s in (1, -1))
    np.testing.assert_allclose(LAW.by_width(FORCE), np.subtract(*widths) / (2 * h), atol=1e-6)


def fitted(limit: float, width: float, seed: int) -> tuple[Search, Candidate, float]:
    """A neo-Hookean film over a triangle behind a cell that ends at the part ``limit`` of its largest force, rounded by
    a parabola over ``width`` of that to either side; its plain fit, and the limit, N.
    """
    empty = measured(np.ones(240), triangle(240))
    film = Forward(CLAIM, empty, empty.deflection, api.solve)(np.array([[np.log(16.0)]]), reached=False).force[0]
    most = limit * float(np.max(film))
    over = np.clip((film - most) / (width * most), -1.0, 1.0)
    shown = np.where(film < (1 + width) * most, film - width * most * (over + 1) ** 2 / 4, most)
    m = replace(empty, force=shown + SD * np.random.default_rng(seed).standard_normal(film.size))
    search = Search(m, white_noise(m), 0, api.solve)
    base = search.fit(CLAIM, search.material_starts(CLAIM))
    assert base is not None
    return search, base, most


@pytest.mark.parametrize("width", [0.01, 0.06])
def test_a_limit_of_another_law_is_found_with_its_softness(width: float) -> None:
    search, base, most = fitted(0.93, width, 4301)
    found = saturated(search, base)
    assert found is not None
    assert found.log_evidence - weighed(search.linear(base), base.theta).log_evidence > 20.0
    assert found.law.limit == pytest.approx(most, rel=0.01)
    left = search.measurement.force - found.reading
    assert np.sqrt(np.mean(left**2)) < 1.15 * SD
    assert 0.05 * width < 1 / found.law.sharpness < width
    again = saturated(search, base, found)  # from where it was found
    assert again is not None
    assert again.law.limit == pytest.approx(found.law.limit, rel=1e-3)
    assert again.log_evidence == pytest.approx(found.log_evidence, abs=0.2)


@pytest.mark.parametrize("seed", range(4310, 4316))
def test_a_peak_is_no_limit(seed: int) -> None:
    search, base, _ = fitted(3.0, 0.01, seed)
    found = saturated(search, base)
    plain = weighed(search.linear(base), base.theta).log_evidence
    assert found is None or found.log_evidence - plain < 0.0
