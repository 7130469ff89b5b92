"""Both estimators against closed forms, and the rules by which their answers are put together."""

import re
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.calibration.prior import Mass
from bayesmembrane.calibration.sampling.proposals.mixture import fit_mixture
from bayesmembrane.calibration.sampling.weights import worth
from bayesmembrane.comparison.evidence import closer
from bayesmembrane.comparison.evidence.bridge import bridge
from bayesmembrane.comparison.evidence.closer import GOOD, Closer
from bayesmembrane.comparison.evidence.estimate import BRIDGE, NESTED, Disagreement, together
from bayesmembrane.comparison.evidence.nested import nested
from bayesmembrane.comparison.evidence.population import lead
from bayesmembrane.comparison.evidence.search import search
from bayesmembrane.comparison.evidence.target import EvidenceEstimate, Problem
from bayesmembrane.comparison.parts import drop_pieces, kept
from bayesmembrane.ground.errors import SettingsError
from tests.statistics.evidence_targets import Banana, Box, Cut, Linear, Modes, NormalGamma, Shells

LOOSE = 0.25  # of nested sampling, where a test is about something else


@pytest.mark.parametrize(
    "target",
    [Linear([1.0, 0.2]), Linear(np.geomspace(1, 0.01, 5)), NormalGamma()],
    ids=["linear 2", "linear 5", "normal-gamma"],
)
def test_bridge_is_exact_on_conjugate_models(target):
    found = bridge(target, seed=101)
    assert abs(found.log_evidence - target.exact) < min(0.05, 5 * found.sd + 0.005)


@pytest.mark.parametrize("target", [Modes(2), Modes(4), Banana(2)], ids=["modes 2", "modes 4", "banana"])
def test_bridge_is_exact_on_separate_modes_and_on_a_curved_valley(target):
    found = bridge(target, seed=102)
    assert abs(found.log_evidence - target.exact) < min(0.05, 5 * found.sd + 0.005)


@pytest.mark.parametrize(
    "target",
    [Linear([1.0, 0.2]), NormalGamma(), Modes(2), pytest.param(Modes(4), marks=pytest.mark.study), Banana(2)],
    ids=lambda t: type(t).__name__,
)
def test_nested_is_right_within_three_standard_errors(target):
    found = nested(target, 103, tolerance=LOOSE)
    assert found.sd <= LOOSE
    assert abs(found.log_evidence - target.exact) < 3 * found.sd


def test_both_estimators_agree_and_carry_the_mass_of_a_cut_prior():
    target = Cut(2)
    found = together({NESTED: nested(target, 104), BRIDGE: bridge(target, seed=104)}, Mass(target.mass, 0.01))
    exact = target.exact - np.log(target.mass)
    assert found.disagreement is None
    for name in (NESTED, BRIDGE):
        sd = found.log_evidence_sd[name]
        assert sd >= 0.01 / target.mass
        assert abs(found.log_evidence[name] - exact) < 3 * sd
        assert found.evaluations[name] > 1000
    value, sd = found.best
    assert min(found.log_evidence.values()) <= value <= max(found.log_evidence.values())
    assert sd == pytest.approx(min(found.log_evidence_sd.values()))


# ---- draws that somebody else made -----------------------------------------------------------------------------------


def exact_draws(target: Linear, count: int, rng: np.random.Generator) -> np.ndarray:
    precision = target.a.T @ target.a + np.eye(target.dimension)
    mean = np.linalg.solve(precision, target.a.T @ target.y)
    return rng.multivariate_normal(mean, np.linalg.inv(precision), count)


def test_bridge_takes_flat_draws_and_ensembles():
    target, rng = Linear([1.0, 0.3, 0.05]), np.random.default_rng(105)
    x = exact_draws(target, 4000, rng)
    flat = bridge(target, x, effective=4000.0, seed=1)
    ensembles = bridge(target, x.reshape(2, 100, 20, 3), seed=1)
    assert abs(flat.log_evidence - target.exact) < 0.02
    assert abs(ensembles.log_evidence - target.exact) < 0.02
    problem = Problem(target)
    known = bridge(target, x, effective=4000.0, seed=1, log_posterior=problem.log_posterior(x))
    assert known.log_evidence == flat.log_evidence
    assert known.evaluations < flat.evaluations


def test_draws_that_are_worth_less_make_the_error_larger():
    target, rng = Linear([1.0, 0.05]), np.random.default_rng(106)
    x = exact_draws(target, 2000, rng)
    assert bridge(target, x, effective=100.0).sd > bridge(target, x, effective=2000.0).sd


def test_autocorrelated_draws_make_the_error_larger():
    target = Linear([1.0, 0.2])
    draws = exact_draws(target, 6400, np.random.default_rng(107)).reshape(2, 400, 8, 2)
    first = np.argsort(draws[..., :1], axis=1)
    slow = np.take_along_axis(draws, first, axis=1)  # the same draws, each walker's from the smallest to the largest
    assert bridge(target, slow).sd > bridge(target, draws).sd


@pytest.mark.parametrize("shape", [(300,), (300, 3), (2, 50, 4, 3)])
def test_draws_of_another_shape_are_refused(shape):
    with pytest.raises(SettingsError, match="draws of the shape"):
        bridge(Banana(2), np.zeros(shape))


def test_flat_draws_need_their_worth_and_few_draws_are_refused():
    with pytest.raises(SettingsError, match="effective"):
        bridge(Banana(2), np.zeros((500, 2)))
    with pytest.raises(SettingsError, match="too few"):
        bridge(Banana(2), np.zeros((50, 2)), effective=50.0)


def test_draws_of_another_target_are_refused():
    with pytest.raises(SettingsError, match="rules out"):
        bridge(Cut(2), np.full((500, 2), -1.0), effective=500.0)


# ---- the same seed, the same answer ----------------------------------------------------------------------------------


def test_the_seed_decides():
    target = Linear([1.0, 0.2])
    assert bridge(target, seed=5).log_evidence == bridge(target, seed=5).log_evidence
    found, again, other = (nested(target, seed, tolerance=0.4).log_evidence for seed in (5, 5, 6))
    assert found == again != other


class KilledError(Exception):
    """Stands for the end of the process."""


def test_nested_that_is_killed_goes_on_after_its_last_run_to_the_same_answer(tmp_path):
    """Killed again and again, each time before another run is kept."""
    target = Modes(2)
    whole = nested(target, 7, tolerance=0.4)
    starts = 0

    def keep(name, make):
        if (tmp_path / "comparison" / f"nested-{name}.json").exists():
            return kept(tmp_path, f"nested-{name}", "key", lambda: pytest.fail("made twice"))
        if made:
            raise KilledError
        made.append(name)
        return kept(tmp_path, f"nested-{name}", "key", make)

    found = None
    while found is None:
        made: list[str] = []
        starts += 1
        with suppress(KilledError):
            found = nested(target, 7, tolerance=0.4, keep=keep)
    assert starts >= len(whole.parts) >= 3
    assert replace(found, seconds=0.0) == replace(whole, seconds=0.0)
    drop_pieces(tmp_path, "nested")
    assert not list((tmp_path / "comparison").iterdir())


# ---- agreement -------------------------------------------------------------------------------------------------------


def pair(a: float, sa: float, b: float, sb: float, mass: Mass | None = None):
    return together({NESTED: EvidenceEstimate(a, sa, 10, 0.1), BRIDGE: EvidenceEstimate(b, sb, 10, 0.1)}, mass)


def test_agreement_needs_nearness_and_precision():
    assert pair(-10.0, 0.1, -10.1, 0.01).agreed
    far = pair(-10.0, 0.1, -10.5, 0.01)
    assert not far.agreed
    assert far.disagreement is Disagreement.APART
    vague = pair(-10.0, 0.3, -10.1, 0.1)
    assert not vague.agreed
    assert vague.disagreement is Disagreement.WIDE
    assert pair(-np.inf, 0.1, -10.0, 0.1).disagreement is Disagreement.NOT_FINITE


def test_a_difference_that_changes_no_odds_blocks_nothing_and_is_in_the_error() -> None:
    """Among fifteen hypotheses one pair lay 2.1 joint errors of 0.02 apart, and nothing was ranked."""
    near = pair(11.33, 0.02, 11.28, 0.005)
    assert near.agreed
    assert near.best[1] == pytest.approx(0.025)
    assert pair(11.30, 0.02, 11.28, 0.005).best[1] == pytest.approx(0.005)
    assert not pair(11.40, 0.02, 11.28, 0.005).agreed


def test_the_error_of_the_mass_counts_for_precision_but_not_as_an_excuse():
    mass = Mass(0.5, 0.1)
    assert not pair(-10.0, 0.05, -10.3, 0.05, mass).agreed
    assert pair(-10.0, 0.05, -10.2, 0.05, Mass(0.5, 0.05)).disagreement is Disagreement.APART
    assert pair(-10.0, 0.1, -10.1, 0.1, Mass(0.5, 0.02)).log_evidence[NESTED] == pytest.approx(-10.0 - np.log(0.5))


# ---- what a target may not do ----------------------------------------------------------------------------------------


class Odd(Box):
    def __init__(self, likelihood) -> None:
        super().__init__(2, 0.0, 1.0)
        self.log_likelihood = likelihood


@pytest.mark.parametrize(
    ("likelihood", "words"),
    [
        (lambda x: np.full(len(x), np.nan), "log_likelihood is nan"),
        (lambda x: np.full(len(x), np.inf), "log_likelihood is inf"),
        (lambda x: np.zeros((len(x), 1)), "the shape"),
        (lambda x: np.full(len(x), -np.inf), "both positive at only 0"),
    ],
)
@pytest.mark.parametrize("estimator", [bridge, lambda t: nested(t, 0)], ids=["bridge", "nested"])
def test_a_target_that_answers_nonsense_is_told(likelihood, words, estimator):
    with pytest.raises(SettingsError, match=words):
        estimator(Odd(likelihood))


def test_a_constant_likelihood_has_itself_as_evidence():
    target = Odd(lambda x: np.where(x[:, 0] < 0.25, -3.0, -np.inf))
    assert nested(target, 0).log_evidence == pytest.approx(-3.0 + np.log(0.25), abs=0.3)
    assert bridge(target).log_evidence == pytest.approx(-3.0 + np.log(0.25), abs=0.03)


# ---- the pieces ------------------------------------------------------------------------------------------------------


def test_a_mixture_integrates_to_one_and_draws_what_it_says():
    rng = np.random.default_rng(108)
    x = np.concatenate([rng.normal(-3, 0.5, (900, 2)), rng.normal(2, [0.2, 1.0], (600, 2))])
    g = fit_mixture(rng.permutation(x), rng)
    assert len(g.means) > 1
    y = rng.uniform(-12, 12, (200_000, 2))
    assert np.mean(np.exp(g.log_density(y))) * 24**2 == pytest.approx(1.0, abs=0.03)
    drawn = g.draw(rng, 100_000)
    assert np.mean(drawn[:, 0] > 0) == pytest.approx(0.4, abs=0.03)
    grid = np.exp(g.log_density(y))
    assert np.mean(drawn[:, 1] > 1) == pytest.approx(np.sum(grid[y[:, 1] > 1]) / np.sum(grid), abs=0.02)


def test_a_density_whose_draws_are_worth_little_is_filled(monkeypatch):
    worths, modes = [], search(Problem(Shells(3)), np.random.default_rng(110))
    for good in (0.0, GOOD):
        monkeypatch.setattr(closer, "GOOD", good)
        near = Closer(Problem(Shells(3)), [np.concatenate(modes.clouds)], modes, np.random.default_rng(111))
        x = near.q.draw(np.random.default_rng(112), 4000)
        worths.append(worth(near.problem.log_posterior(x) - near.q.log_density(x)))
    assert worths[0].efficiency < GOOD
    assert worths[1].efficiency > 2 * worths[0].efficiency
    assert abs(worths[1].log_mean - Shells(3).exact) < 4 * worths[1].log_mean_sd


def test_a_population_is_led_to_the_wanted_distribution():
    rng = np.random.default_rng(109)

    def terms(x):
        return -0.5 * np.sum(x * x, axis=1), -0.5 * np.sum((x - 3) ** 2, axis=1) / 0.25

    found = lead(terms, rng.standard_normal((2000, 2)), rng, 4)
    x = found.x.reshape(-1, 2)
    assert np.mean(x, axis=0) == pytest.approx([2.4, 2.4], abs=0.05)
    assert np.var(x, axis=0) == pytest.approx([0.2, 0.2], abs=0.03)
    exact = 2 * (0.5 * np.log(0.2) - 0.5 * 9 / 1.25)
    assert found.log_ratio == pytest.approx(exact, abs=0.25)


def test_the_page_on_evidence_has_an_example_that_runs():
    """What stands in docs/evidence.md as python is what a reader will copy."""
    text = (Path(__file__).parents[2] / "docs" / "evidence.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    known: dict = {}
    exec(compile(block, "docs/evidence.md", "exec"), known)
    assert known["found"].agreed
    for name in (NESTED, BRIDGE):
        error = known["found"].log_evidence[name] - known["exact"]
        assert abs(error) < 6 * known["found"].log_evidence_sd[name] + 0.01
