"""What two effects promise together equals what two further columns bring to the linear model."""

from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.evidence import Block, extended
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.candidates.signatures import slopes_of_effect
from bayesmembrane.diagnosis.explanation.beliefs import BELIEFS
from bayesmembrane.diagnosis.explanation.promise import first_order, gains_of_pairs, promised
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus
from tests.diagnosis.curves import white_noise
from tests.generator.film import Film

SD = 0.004
OFFSETS = [components("effects")[n]() for n in ("force_offset", "zero_offset")]


@pytest.fixture(scope="module")
def fitted() -> tuple[Search, Candidate]:
    """A film whose zeros are both off: one hides the other."""
    rng, path = np.random.default_rng(61), np.linspace(0.0, 0.03, 91)[1:]
    force = Film("neo_hookean", (8.0,), 0.010, 0.035, 0.04).force(path + 2e-4) - 0.01
    m = Measurement(path, force + SD * rng.standard_normal(path.size), Annulus(0.010, 0.035), Specimen("film", 5e-5))
    search, plain = Search(m, white_noise(m, SD, 80.0)), hypothesis("neo_hookean")
    found = search.fit(plain, search.material_starts(plain))
    assert found is not None
    return search, found


def columns(search: Search, base: Candidate, shape: int = 0) -> Array:
    """Slopes of both offsets by their expected sizes, that of the force in one of its shapes."""
    each = [(slopes_of_effect(search, base, e), float(search.expected_sizes(e)[0])) for e in OFFSETS]
    return np.column_stack([slopes[min(shape, len(slopes) - 1)][0] * size for slopes, size in each])


def test_two_at_once_equal_two_further_columns(fitted: tuple[Search, Candidate]) -> None:
    search, base = fitted
    model = search.linear(base)
    usual = np.minimum(base.theta, model.priors[:, 0])
    here = model.log_density(base.theta).value
    shapes = range(len(slopes_of_effect(search, base, OFFSETS[0])))
    more = [extended(model, [Block(search.noise.white(columns(search, base, s)))]) for s in shapes]
    expected = max(m.log_density(theta).value - here for m in more for theta in (base.theta, usual))
    assert gains_of_pairs(search, base, OFFSETS) == {
        frozenset(("force_offset", "zero_offset")): pytest.approx(expected, abs=0.01)
    }


def test_two_promise_more_than_either_where_each_hides_the_other(fitted: tuple[Search, Candidate]) -> None:
    search, base = fitted
    (together,) = gains_of_pairs(search, base, OFFSETS).values()
    assert together > max(first_order(search, base, e) for e in OFFSETS)


@pytest.mark.parametrize("counts", [0.3, 0.5, 1.0])
def test_what_is_promised_is_a_part_of_the_likelihood_over_sizes_that_are_seen(
    fitted: tuple[Search, Candidate], counts: float
) -> None:
    """The likelihood of every size from data without its trace, and the prior of what can be seen, by sums."""
    search, base = fitted
    model = search.linear(base)
    usual = np.minimum(base.theta, model.priors[:, 0])
    here = model.log_density(base.theta).value
    for i, effect in enumerate(OFFSETS):
        weights, own = [], search.noise.white(base.slopes)
        for shape in range(len(slopes_of_effect(search, base, effect))):
            white = search.noise.white(columns(search, base, shape))[:, i]
            length = np.linalg.norm(white - own @ np.linalg.lstsq(own, white, rcond=None)[0])
            r = np.linspace(BELIEFS.visible, 80.0, 4000)
            prior = np.minimum(1 / r, length / r**2) / (1 + np.log(length / BELIEFS.visible))
            for theta in (base.theta, usual):
                log_l = []
                for step in (white / length, -white / length):
                    here_and_there = [replace(model, data=model.data - a * step) for a in r[::40]]
                    each = [m.log_density(theta).value - here for m in here_and_there]
                    log_l.append(np.interp(r, r[::40], each))
                weights.append(np.log(0.5 * sum(np.trapezoid(prior * np.exp(counts * v), r) for v in log_l)))
            assert length > BELIEFS.visible
        assert promised(search, base, effect, counts) == pytest.approx(max(weights), abs=0.1)


def test_an_effect_alone_is_no_pair(fitted: tuple[Search, Candidate]) -> None:
    assert gains_of_pairs(*fitted, OFFSETS[:1]) == {}
    assert gains_of_pairs(*fitted, []) == {}
