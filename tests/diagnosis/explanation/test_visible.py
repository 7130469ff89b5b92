"""Effects count as there where their own trace can be seen: the ratios, and what evidence gains by that prior."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.diagnosis.candidates.candidate import Candidate, with_effects
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.explanation.visible import LEAST, Ratio, log_seen
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus
from tests.diagnosis.curves import white_noise
from tests.generator.film import Film

SD = 0.004
OFFSET = components("effects")["force_offset"]()


def evidence(density: object, centre: float, ends: tuple[float, float]) -> float:
    """The integral of a prior ``density`` times a likelihood N(centre, 1) between ``ends``, by another quadrature."""
    return float(quad(lambda r: density(r) * np.exp(-0.5 * (r - centre) ** 2), *ends, limit=400, points=[centre])[0])  # type: ignore[operator]


@pytest.mark.parametrize("one_sided", [True, False])
@pytest.mark.parametrize(("centre", "expected"), [(30.0, 80.0), (6.0, 80.0), (4.0, 20.0)])
def test_it_is_what_evidence_gains_by_the_other_prior(centre: float, expected: float, one_sided: bool) -> None:
    """Likelihoods N(centre, 1) of a ratio under Cauchy's prior and under the ln-uniform one."""
    sides = 1 if one_sided else 2
    low = 0.0 if one_sided else centre - 12

    def cauchy(r: float) -> float:
        return 2 / sides / (np.pi * expected * (1 + (r / expected) ** 2))

    def uniform(r: float) -> float:
        return min(1 / r, expected / r**2) / sides / (1 + np.log(expected / BELIEFS.visible))

    whole = sides * quad(uniform, BELIEFS.visible, np.inf, limit=400)[0]
    assert whole == pytest.approx(1.0, rel=1e-3)
    before = evidence(cauchy, centre, (low, centre + 12))
    after = evidence(uniform, centre, (BELIEFS.visible, centre + 12))
    ends = (low, centre + 12)
    mean = evidence(lambda r: r * cauchy(r), centre, ends) / before
    sd = np.sqrt(evidence(lambda r: (r - mean) ** 2 * cauchy(r), centre, ends) / before)
    found = Ratio(mean, float(sd), expected, one_sided).log_seen
    assert found == pytest.approx(np.log(after / before), abs=0.03)


def test_what_cannot_be_seen_counts_as_absent() -> None:
    assert Ratio(0.4, 0.2, 50.0, True).log_seen == pytest.approx(np.log(LEAST))
    assert Ratio(0.0, 0.0, 0.0, True).log_seen == pytest.approx(np.log(LEAST))
    rising = [Ratio(m, 1.0, 50.0, True).log_seen for m in (0.0, 1.0, 2.0, 3.0, 4.0)]
    assert np.all(np.diff(rising) > 0)


def test_the_size_that_is_expected_is_no_tuning() -> None:
    """A trace of ratio 8 is worth nearly the same whether ratios of 20 or of 200 were expected.

    Under Cauchy's prior ln Z differs by ln 10, nearly.
    """
    gained = {e: Ratio(8.0, 1.0, e, True).log_seen for e in (20.0, 200.0)}
    log_z = {e: -np.log(e * (1 + (8.0 / e) ** 2)) for e in gained}
    whole = {e: log_z[e] + gained[e] for e in gained}
    assert log_z[20.0] - log_z[200.0] > 2.0
    assert abs(whole[20.0] - whole[200.0]) < 1.0


@pytest.fixture(scope="module")
def film() -> tuple[Search, float]:
    """A neo-Hookean film with an offset of the force, and that offset."""
    rng, path, offset = np.random.default_rng(67), np.linspace(0.0, 0.03, 91)[1:], 0.011
    force = Film("neo_hookean", (8.0,), 0.010, 0.035, 0.04).force(path) - offset
    m = Measurement(path, force + SD * rng.standard_normal(path.size), Annulus(0.010, 0.035), Specimen("film", 5e-5))
    return Search(m, white_noise(m, SD, 80.0)), offset


def fitted(search: Search) -> Candidate:
    plain = hypothesis("neo_hookean")
    base = search.fit(plain, search.material_starts(plain))
    assert base is not None
    found = search.fit(with_effects(plain, [OFFSET]), [np.concatenate([base.x, OFFSET.null])])
    assert found is not None
    return found


def test_the_square_of_a_ratio_is_what_chi_square_loses_without_the_effect(film: tuple[Search, float]) -> None:
    """Of a linear effect: what is left of its trace once the film has taken what it can, by least squares."""
    search, offset = film
    found = fitted(search)
    assert abs(found.x[-1]) == pytest.approx(offset, rel=0.3)

    def ratio(size: float) -> float:
        white = search.noise.white(found.slopes)
        taken = np.linalg.lstsq(white[:, :-1], white[:, -1] * size, rcond=None)[0]
        return float(np.linalg.norm(white[:, -1] * size - white[:, :-1] @ taken))

    size, sd = abs(found.x[-1]), np.sqrt(search.covariance(found)[-1, -1])
    expected = Ratio(ratio(size), ratio(sd), ratio(float(search.expected_sizes(OFFSET)[0])), False)
    assert log_seen(search, found, (), {}) == pytest.approx(expected.log_seen, rel=1e-6)
    assert log_seen(search, found, ("force_offset",), {}) == 0.0


def test_a_bent_trace_is_as_large_as_what_a_fit_without_it_leaves(film: tuple[Search, float]) -> None:
    """Where the film absorbs it nearby, but not elsewhere: by the squares that the effect takes away."""
    search, _ = film
    found = fitted(search)
    faint = replace(found, slopes=np.column_stack([found.slopes[:, :-1], 1e-3 * found.slopes[:, -1]]))
    absorbed = log_seen(search, faint, (), {})
    seen = [log_seen(search, faint, (), {"force_offset": r**2}) for r in (1.0, 2.0, 4.0)]
    assert absorbed == pytest.approx(np.log(LEAST))
    assert np.all(np.diff([absorbed, *seen]) > 0)
    assert log_seen(search, found, (), {"force_offset": 1e6}) == log_seen(search, found, (), {})


def test_ratios_are_raised_and_never_lowered() -> None:
    here = Ratio(2.0, 0.5, 4.0, True)
    assert here.at_least(1.0) == here
    assert here.at_least(8.0) == Ratio(8.0, 1.0, 16.0, True)
    assert Ratio(0.0, 0.5, 4.0, True).at_least(8.0) == Ratio(0.0, 0.5, 4.0, True)
