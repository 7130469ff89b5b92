"""Effects count as there where their own trace can be seen: the ratios, and what a weight gains by that prior."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.diagnosis.candidates.candidate import Candidate, with_effects
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.explanation.promise import promised
from bayesmembrane.diagnosis.explanation.visible import LEAST, Ratio, log_seen, own_ratio
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus
from tests.diagnosis.curves import white_noise
from tests.generator.film import Film

SD = 0.004
OFFSET = components("effects")["force_offset"]()
SIZE = 1
"""Number of the offset, after the modulus: what follows are its shapes."""


def evidence(density: object, centre: float, ends: tuple[float, float], counts: float) -> float:
    """int density(r) exp(-c (r - centre)^2 / 2) dr between ``ends``, by another quadrature."""
    cuts = [p for p in (centre, -BELIEFS.visible, 0.0, 0.1, BELIEFS.visible) if ends[0] < p < ends[1]]
    whole = quad(lambda r: density(r) * np.exp(-0.5 * counts * (r - centre) ** 2), *ends, limit=400, points=cuts)  # type: ignore[operator]
    return float(whole[0])


COUNTS = (1.0, 0.5)


@pytest.mark.parametrize("counts", COUNTS)
@pytest.mark.parametrize("one_sided", [True, False])
@pytest.mark.parametrize(
    ("centre", "expected"),
    [(30.0, 80.0), (6.0, 80.0), (4.0, 20.0), (-1.0, 20.0), (-8.0, 20.0), (5.0, 0.3), (300.0, 8.0)],
)
def test_it_is_what_a_weight_gains_by_the_other_prior(
    centre: float, expected: float, one_sided: bool, counts: float
) -> None:
    """A part of likelihoods N(centre, 1) of a ratio under Cauchy's prior, and under the ln-uniform one."""
    sides = 1 if one_sided else 2
    # The likelihood is that of a ratio: what is not allowed, its slope at 0 cuts off.
    low, high = (0.0 if one_sided else -abs(centre) - 12), abs(centre) + 12

    def cauchy(r: float) -> float:
        return 2 / sides / (np.pi * expected * (1 + (r / expected) ** 2))

    usual = max(expected, BELIEFS.visible)

    def uniform(r: float) -> float:
        own = min(1 / abs(r), usual / r**2) if abs(r) >= BELIEFS.visible else 0.0
        return own / sides / (1 + np.log(usual / BELIEFS.visible)) * expected / usual

    large_enough = min(expected / BELIEFS.visible, 1.0)
    assert sides * quad(uniform, BELIEFS.visible, np.inf, limit=400)[0] == pytest.approx(large_enough, rel=1e-3)
    ends = low if one_sided else low - 6, high + 6
    before, after = (evidence(prior, centre, ends, counts) for prior in (cauchy, uniform))
    found = Ratio(centre, 1.0, expected, one_sided)
    assert found.log_part(counts) == pytest.approx(np.log(after), abs=0.03)
    assert found.log_before(counts) == pytest.approx(np.log(before), abs=0.03)
    gained = np.log(after) - np.log(before)
    assert found.log_seen(counts) == pytest.approx(max(gained, np.log(LEAST)), abs=0.03)


@pytest.mark.parametrize("counts", COUNTS)
def test_what_cannot_be_seen_counts_as_absent(counts: float) -> None:
    assert Ratio(0.0, 0.1, 50.0, True).log_seen(counts) == pytest.approx(np.log(LEAST))
    assert Ratio(0.0, 0.0, 0.0, True).log_seen(counts) == pytest.approx(np.log(LEAST))
    assert Ratio(-30.0, 1.0, 50.0, True).log_seen(counts) == pytest.approx(np.log(LEAST))
    rising = [Ratio(m, 1.0, 50.0, True).log_seen(counts) for m in (-3.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0)]
    assert np.all(np.diff(rising) > 0)


@pytest.mark.parametrize("expected", [5.0, 50.0, 5000.0])
@pytest.mark.parametrize("counts", [1.0, 0.5, 0.2])
def test_no_effect_gains_more_than_its_likelihood_says(expected: float, counts: float) -> None:
    """However much its size cost before the data: beside one that does nothing for the fit a set has less weight."""
    centre = 1.0
    ratio = Ratio(centre, 1.0, expected, True)
    log_z = np.log(evidence(lambda r: 2 / (np.pi * expected * (1 + (r / expected) ** 2)), centre, (0.0, 40.0), counts))
    taken = 0.5 * centre**2  # by the best size from the squares of a fit without it, in ln of the likelihood
    assert log_z + counts * taken + ratio.log_seen(counts) < 0.0


@pytest.mark.parametrize("mean", [0.3, 1e-4, 1e-9])
@pytest.mark.parametrize("counts", COUNTS)
def test_a_raised_ratio_gains_no_more_for_having_been_small(mean: float, counts: float) -> None:
    """What a fit without it leaves says how large the trace is, and not what its size has cost in ln Z."""
    small, seen = Ratio(mean, 0.5, 1.0, True), Ratio(4.0, 1.0, 4.0 / mean, True)
    gained = small.log_seen(counts, squares=16.0)
    assert gained == pytest.approx(seen.log_part(counts) - small.log_before(counts))
    assert gained < 0.0


def test_the_size_that_is_expected_is_no_tuning() -> None:
    """A trace of ratio 8 is worth nearly the same whether ratios of 20 or of 200 were expected.

    Under Cauchy's prior ln Z differs by ln 10, nearly.
    """
    gained = {e: Ratio(8.0, 1.0, e, True).log_seen(1.0) for e in (20.0, 200.0)}
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
    assert abs(found.x[SIZE]) == pytest.approx(offset, rel=0.3)

    def ratio(size: float) -> float:
        white = search.noise.white(found.slopes)
        taken = np.linalg.lstsq(white[:, :SIZE], white[:, SIZE] * size, rcond=None)[0]
        return float(np.linalg.norm(white[:, SIZE] * size - white[:, :SIZE] @ taken))

    size, sd = abs(found.x[SIZE]), np.sqrt(search.covariance(found)[SIZE, SIZE])
    usual = float(search.expected_sizes(OFFSET)[0])
    local = ratio(float(search.steepness(found)[SIZE]))
    expected = Ratio(ratio(size), ratio(sd), ratio(usual), False).without_prior(local).resolved
    assert log_seen(search, found, (), {}, 0.5) == pytest.approx(expected.log_seen(0.5), rel=1e-6)
    assert log_seen(search, found, ("force_offset",), {}, 0.5) == 0.0


def test_a_bent_trace_is_as_large_as_what_a_fit_without_it_leaves(film: tuple[Search, float]) -> None:
    """Where the film absorbs it nearby, but not elsewhere: by the squares that the effect takes away."""
    search, _ = film
    found = fitted(search)
    faint = replace(found, slopes=found.slopes * np.where(np.arange(found.x.size) < SIZE, 1.0, 1e-3))
    absorbed = log_seen(search, faint, (), {}, 1.0)
    seen = [log_seen(search, faint, (), {"force_offset": r**2}, 1.0) for r in (1.0, 2.0, 4.0)]
    assert absorbed < np.log(0.1)
    assert np.all(np.diff([absorbed, *seen]) >= 0)
    assert absorbed <= seen[1] < seen[2]
    assert log_seen(search, found, (), {"force_offset": 1e6}, 1.0) == log_seen(search, found, (), {}, 1.0)


def test_ratios_are_raised_and_never_lowered() -> None:
    here = Ratio(2.0, 0.5, 4.0, True)
    assert here.at_least(1.0) == here
    assert here.at_least(8.0) == Ratio(8.0, 1.0, 16.0, True)
    assert Ratio(0.0, 0.5, 4.0, True).at_least(8.0) == Ratio(0.0, 0.5, 4.0, True)


def test_one_size_in_each_of_several_tests_has_the_ratio_of_the_whole_trace() -> None:
    """Two tests of readings of their own: squares add up, and what is sure in one alone counts as far as it does."""
    traces = np.zeros((20, 2))
    traces[:10, 0], traces[10:, 1] = 3.0, 2.0
    sizes, usual, covariance = np.array([0.2, 0.5]), np.array([1.0, 2.0]), np.diag([0.01, 0.04])
    lengths = np.linalg.norm(traces, axis=0)
    found = own_ratio(traces, sizes, covariance, usual, local=usual, one_sided=True)
    each = sizes * lengths
    assert found.mean == pytest.approx(np.linalg.norm(each))
    assert found.expected == pytest.approx(np.linalg.norm(lengths * usual))
    part = each / np.linalg.norm(each)
    assert found.sd == pytest.approx(np.sqrt(np.sum((part * lengths) ** 2 * np.diag(covariance))))
    assert own_ratio(traces, -sizes, covariance, usual, local=usual, one_sided=True).mean == pytest.approx(-found.mean)
    assert own_ratio(traces, -sizes, covariance, usual, local=usual, one_sided=False).mean == pytest.approx(found.mean)
    assert own_ratio(
        traces, np.array([0.0, 0.5]), covariance, usual, local=usual, one_sided=True
    ).mean == pytest.approx(each[1])
    assert own_ratio(traces, np.zeros(2), covariance, usual, local=usual, one_sided=True).mean == 0.0


def test_a_size_that_is_stopped_at_nothing_is_judged_by_what_the_data_ask_for() -> None:
    """A loop of the wrong sense: friction is fitted as none, and has the weight that its trace promises."""
    rng, up = np.random.default_rng(68), np.linspace(0.0, 0.03, 41)[1:]
    path = np.concatenate([up, up[-2::-1]])
    force = Film("neo_hookean", (8.0,), 0.010, 0.035, 0.04).force(path)
    loop = np.where(np.arange(path.size) < up.size, -1.0, 1.0) * 1.2e-3
    y = force + loop + SD * rng.standard_normal(path.size)
    m = Measurement(path, y, Annulus(0.010, 0.035), Specimen("film", 5e-5))
    search, plain, friction = (
        Search(m, white_noise(m, SD, 80.0)),
        hypothesis("neo_hookean"),
        components("effects")["friction"](),
    )
    base = search.fit(plain, search.material_starts(plain))
    assert base is not None
    start = np.concatenate([base.x, friction.null])
    found = search.fit(with_effects(plain, [friction]), [start])
    assert found is not None
    assert found.parameters["friction.level"] == 0.0
    for counts in COUNTS:
        gain = search.log_tempered(found, counts) - search.log_tempered(base, counts)
        whole = gain + log_seen(search, found, (), {}, counts)
        assert whole == pytest.approx(promised(search, base, friction, counts), abs=0.7)
        assert whole < -4.0


def test_a_trace_that_priors_of_others_leave_whole_is_seen_whole() -> None:
    """A tenth of it is left by what others could do, and all of it by what they do: its own deviation says so."""
    whole, left = Ratio(8.0, 1.0, 20.0, True), Ratio(0.8, 0.1, 2.0, True)
    assert left.resolved == whole
    assert whole.resolved == whole
    assert Ratio(5.0, 3.0, 20.0, True).resolved == Ratio(5.0, 3.0, 20.0, True)


@pytest.mark.parametrize("sd", [0.3, 0.7])
def test_a_posterior_without_its_prior_is_the_likelihood(sd: float) -> None:
    """N(m0, s0^2) times N(0, R^2) and divided by it again."""
    expected, mean = 0.9, 0.8
    certain = 1 / (1 / sd**2 + 1 / expected**2)
    found = Ratio(mean * certain / sd**2, np.sqrt(certain), expected, False).without_prior(expected)
    assert (found.mean, found.sd) == pytest.approx((mean, sd))


def test_far_out_a_size_is_told_by_the_data_alone() -> None:
    """Cauchy's prior is flat where a size is eight times the expected one, and says nothing of it there."""
    own, size, usual = np.array([[1.0]]), np.array([0.6]), np.array([0.07])
    far = usual * np.sqrt(0.5 * (1 + (size / usual) ** 2))
    found = own_ratio(own, size, np.array([[0.11**2]]), usual, local=far, one_sided=True)
    assert found.mean == pytest.approx(size[0] / 0.11, rel=0.05)
    assert found.sd == pytest.approx(1.0)
