"""The joint posterior is what it says: one prior, and the likelihoods of all tests."""

import numpy as np
import pytest

from bayesmembrane.calibration.joint.claim import Joint, JointTest, joint
from bayesmembrane.calibration.joint.posterior import JointPosterior
from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis
from tests.calibration.joint.tests_of import SHEET, STRIP, made

MR = (8.0, 2.0)


def draws(posterior: JointPosterior, count: int = 40, seed: int = 1) -> np.ndarray:
    return posterior.prior.draw(np.random.default_rng(seed), count)


def both_tests() -> dict[str, Measurement]:
    return {
        "strip": made(STRIP, "mooney_rivlin", MR, seed=2, thickness=2e-4),
        "sheet": made(SHEET, "mooney_rivlin", MR, seed=3, specimen="sheet", stated=False),
    }


def test_one_test_is_the_posterior_of_a_single_measurement() -> None:
    claim, m = hypothesis("mooney_rivlin", ["zero_offset"], "ar1"), made(STRIP, "mooney_rivlin", MR)
    alone, one = Posterior(claim, m), JointPosterior(joint([m], claim))
    x = draws(one)
    assert one.size == alone.size
    a, b = alone.evaluate(x), one.evaluate(x)
    np.testing.assert_array_equal(a.log_prior, b.log_prior)
    inside = np.isfinite(a.log_prior)
    np.testing.assert_allclose(b.log_likelihood[inside], a.log_likelihood[inside], rtol=1e-13)
    np.testing.assert_array_equal(a.outcome, b.outcome)
    np.testing.assert_allclose(one.joint.natural(x), claim.natural(x, m), rtol=1e-14)


def test_likelihoods_add_up_with_each_film_in_its_own_thickness() -> None:
    claim = hypothesis("mooney_rivlin", ["zero_offset"])
    p = JointPosterior(joint(both_tests(), claim))
    x = draws(p)
    found = p.evaluate(x)
    films = {label: p.joint.of(i, x) for i, label in enumerate(p.joint.labels)}
    # Membrane parameters go with the thickness, and pure numbers stay.
    np.testing.assert_allclose(claim.films(films["strip"]), 2 * claim.films(films["sheet"]), rtol=1e-12)
    each = [Posterior(claim, m).evaluate(films[label]) for label, m in both_tests().items()]
    ok = np.isfinite(found.log_posterior)
    assert np.count_nonzero(ok) > 5
    np.testing.assert_allclose(found.log_likelihood[ok], sum(e.log_likelihood for e in each)[ok], rtol=1e-12)
    np.testing.assert_array_equal(ok, np.all([np.isfinite(e.log_posterior) for e in each], axis=0))


def test_the_order_of_the_tests_does_not_matter() -> None:
    claim = hypothesis("mooney_rivlin", ["zero_offset"])
    parts = joint(both_tests(), claim).parts
    one, other = JointPosterior(Joint(parts)), JointPosterior(Joint(parts[::-1]))
    x = draws(one)
    moved = x[:, [one.joint.names.index(n) for n in other.joint.names]]
    a, b = one.evaluate(x), other.evaluate(moved)
    np.testing.assert_allclose(a.log_prior, b.log_prior, rtol=1e-13)
    np.testing.assert_allclose(a.log_likelihood, b.log_likelihood, rtol=1e-12)
    assert one.joint.thickness == other.joint.thickness


@pytest.mark.parametrize("noise", ["white", "form"])
def test_what_an_emulator_is_told_is_the_posterior(noise: str) -> None:
    claim = hypothesis("mooney_rivlin", ["zero_offset"], noise)
    p = JointPosterior(joint(both_tests(), claim))
    x = draws(p)
    found = p.evaluate(x)
    ok = np.isfinite(found.log_posterior)
    assert np.any(ok)
    np.testing.assert_allclose(p.given(found.curves[ok], x[ok]), found.log_posterior[ok], rtol=1e-10)


def test_the_mass_of_the_prior_is_that_of_energies_convex_in_every_test() -> None:
    claim = hypothesis("mooney_rivlin")
    both = JointPosterior(joint(both_tests(), claim))
    masses = [JointPosterior(joint([m], claim)) for m in both_tests().values()]
    each = [p.prior.mass(p.inside).value for p in masses]
    found = both.prior.mass(both.inside)
    assert 0 < found.value <= min(each) + 5 * found.sd + 0.01


def test_the_posterior_of_two_strips_is_the_one_of_a_grid() -> None:
    """Neo-Hookean, stated noise alone: one coordinate, and a Gaussian likelihood in the modulus by hand."""
    claim = Hypothesis(hypothesis("neo_hookean").material, noise=hypothesis("neo_hookean", extra_noise=False).noise)
    a = made(STRIP, "neo_hookean", (10.0,), seed=5, noise=0.03)
    b = made(STRIP, "neo_hookean", (10.0,), seed=6, noise=0.01, thickness=3e-4)
    p = JointPosterior(joint({"a": a, "b": b}, claim))
    x = np.linspace(-0.08, 0.08, 401)[:, None] + np.log(20.0)
    precision = linear = constant = 0.0
    for m, thicker in ((a, 1.0), (b, 3.0)):
        stretch = 1 + m.deflection / STRIP.length
        slope = thicker * STRIP.width * (stretch - stretch**-2)  # force of G d = 1 N/m of the thin film
        assert m.force_sd is not None
        precision += float(np.sum((slope / m.force_sd) ** 2))
        linear += float(np.sum(slope * m.force / m.force_sd**2))
        constant += float(np.sum((m.force / m.force_sd) ** 2) + np.sum(np.log(2 * np.pi * m.force_sd**2)))
    gd = np.exp(x[:, 0])
    by_hand = -0.5 * (precision * gd**2 - 2 * linear * gd + constant)
    np.testing.assert_allclose(p.evaluate(x).log_likelihood, by_hand, rtol=1e-9, atol=1e-7)


def test_labels_and_claims_must_go_together() -> None:
    m, other = (made(STRIP, "neo_hookean", (10.0,), seed=s) for s in (0, 1))
    nh = hypothesis("neo_hookean")
    assert joint([m, other], nh).labels == ("strip", "strip-2")
    for fault, match in (
        (lambda: joint([], nh), "no measurement"),
        (lambda: joint({"a b": m}, nh), "cannot be called"),
        (lambda: joint({"walk": m}, nh), "cannot be called"),
        (lambda: joint({"a": m}, {"b": nh}), "not both"),
        (lambda: joint({"a": m, "b": other}, {"a": nh, "b": hypothesis("gent")}), "one energy"),
        (lambda: joint({"a": m, "b": other}, {"a": nh, "b": hypothesis("neo_hookean", convexity="box")}), "one energy"),
        (lambda: Joint((JointTest("a", m, nh), JointTest("a", m, nh))), "two tests"),
    ):
        with pytest.raises(SettingsError, match=match):
            fault()  # type: ignore[no-untyped-call]


def test_a_test_of_too_few_points_is_refused_as_it_is_alone() -> None:
    m = made(STRIP, "neo_hookean", (10.0,)).select(np.arange(2))
    with pytest.raises(SettingsError, match="2 points"):
        JointPosterior(joint([m], hypothesis("yeoh")))
