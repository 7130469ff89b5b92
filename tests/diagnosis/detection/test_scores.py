import numpy as np
import pytest
from scipy.stats import kstest

from bayesmembrane.diagnosis.candidates.candidate import available
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.candidates.signatures import signatures
from bayesmembrane.diagnosis.detection import scores
from bayesmembrane.diagnosis.detection.scores import ScoreTest, Signature, angle, smallest_sizes
from bayesmembrane.diagnosis.reference.inferred import own_noise
from bayesmembrane.diagnosis.reference.noise import whitened
from bayesmembrane.diagnosis.reference.smooth import smooth_reference
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.materials.neo_hookean import NeoHookean
from tests.diagnosis.curves import RIG, SD, SPECIMEN, measured, triangle, white_noise, without
from tests.generator.datasets import generate

N, SEEDS = 150, 200
D = triangle(N)
CURVE = measured(np.zeros(N))
SLOPES = np.vander(D / 0.04, 3)
SHAPES = {
    "offset": (np.where(np.arange(N) < 20, 1.0, 0.0), 0),
    "gap": (CURVE.leg.astype(float), 1),
    "drift": (np.linspace(0, 1, N), 0),
    "late drift": (np.linspace(0, 1, N) ** 2, 0),
    "second cycle": ((CURVE.cycle > 1).astype(float), -1),
}


def score_test(residual, found, noise, rng) -> ScoreTest:
    return scores.score_test(whitened(residual, SLOPES, np.empty((N, 0)), noise), found, rng)


def made() -> list[Signature]:
    out = []
    for name, (shape, side) in SHAPES.items():
        left = without(shape / SD, SLOPES)
        length = float(np.linalg.norm(left))
        out.append(Signature(name, side, left, length, length / float(np.linalg.norm(shape / SD))))
    return out


@pytest.mark.parametrize("dof", [np.inf, 40.0])
def test_probabilities_are_uniform_if_nothing_is_missing(dof) -> None:
    rng = np.random.default_rng(9)
    found, p = made(), []
    for _ in range(SEEDS):
        # An inferred deviation is off by as much as its degrees of freedom say.
        sd = SD if np.isinf(dof) else SD * np.sqrt(rng.chisquare(dof) / dof)
        residual = without(SD * rng.standard_normal(N), SLOPES)
        p.append(score_test(residual, found, white_noise(CURVE, sd, dof), rng).p_value)
    assert kstest(p, "uniform").pvalue > 1e-6  # of right ones, one of a million fails


@pytest.mark.parametrize("name", SHAPES)
def test_a_large_signature_is_found_under_its_name_and_only_on_its_side(name) -> None:
    """Of ten deviations, or so many that five tell it from the next one: scores a and b differ by (1 - cos) of it, with
    a deviation of sqrt(2 (1 - cos)).
    """
    rng = np.random.default_rng(10)
    found = made()
    one = next(f for f in found if f.effect == name)
    near = max(abs(float(f.direction @ one.direction)) for f in found if f is not one)
    size = max(10.0, 5.0 * np.sqrt(2 / (1 - near)))
    noise = without(SD * rng.standard_normal(N), SLOPES)
    for sign in (1, -1):
        test = score_test(noise + size * sign * SD * one.direction, found, white_noise(CURVE), rng)
        if one.one_sided in (0, sign):
            assert test.effect == name
            assert test.p_value < 1e-3
            assert test.value == pytest.approx(size, abs=5)
        else:
            assert test.effect != name
    assert score_test(noise, [], white_noise(CURVE), rng).p_value == 1


def test_the_smallest_size_that_shows_does_so_nine_times_out_of_ten() -> None:
    rng = np.random.default_rng(11)
    found = [f for f in made() if f.effect == "drift"]
    null = score_test(np.zeros(N), found, white_noise(CURVE), rng)
    size = smallest_sizes(found, null.critical)["drift"]
    hits = 0
    for _ in range(200):
        residual = without(size * SHAPES["drift"][0] + SD * rng.standard_normal(N), SLOPES)
        hits += score_test(residual, found, white_noise(CURVE), rng).value > null.critical
    assert 155 <= hits <= 198  # of 180: less in 6e-8 of all cases, more in 2e-8


def test_angles_between_known_directions() -> None:
    a = np.array([1.0, 0.0, 0.0])
    b = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6), 0.0])
    assert angle(a, 3 * b) == pytest.approx(30)
    assert angle(a, -b) == pytest.approx(30)
    assert angle(a, -b, fold=False) == pytest.approx(150)
    assert angle(a, 0 * b) == 0


def test_signatures_are_free_of_what_the_material_absorbs_and_those_without_a_trace_are_left_out() -> None:
    data = generate("null", "neo_hookean", "single", seed=301)
    m = measured(data.force_N, 1e-3 * data.deflection_mm, data.time_s)
    assert (m.rig, m.specimen) == (RIG, SPECIMEN)
    hypothesis = Hypothesis(NeoHookean)
    noise = own_noise(m, smooth_reference(m))
    search = Search(m, noise)
    model = search.fit(hypothesis, search.material_starts(hypothesis))
    found = signatures(search, model, available(m, hypothesis))
    names = {f.effect for f in found}
    assert {"prestretch", "force_offset", "zero_offset"} <= names
    assert "mullins" not in names  # a film that is pulled for the first time has not softened yet
    slopes = noise.white(model.slopes)
    for f in found:
        assert np.max(np.abs(slopes.T @ f.left)) < 1e-6 * np.linalg.norm(slopes) * f.length
        assert 0 < f.seen <= 1 + 1e-12
        assert f.length == pytest.approx(np.linalg.norm(f.left))
