"""Modes that few prior draws see: they are found, or it is said what was covered, and draws that miss them are told."""

import numpy as np
import pytest

from bayesmembrane.comparison.evidence.bridge import bridge
from bayesmembrane.comparison.evidence.estimate import Disagreement, evidence
from bayesmembrane.comparison.evidence.nested import nested
from bayesmembrane.comparison.evidence.search import search
from bayesmembrane.comparison.evidence.target import Problem, smallest
from tests.statistics.evidence_targets import Cut, Linear, Modes, NormalGamma, SpikeAndSlab, Uneven


@pytest.mark.parametrize(
    ("target", "count"),
    [(Uneven(2, 0.02), 2), (Uneven(4, 0.1), 2), (Modes(2), 2), (Linear([1.0, 0.1]), 1), (NormalGamma(), 1)],
    ids=["uneven 2", "uneven 4", "modes", "linear", "normal-gamma"],
)
def test_every_mode_is_found_with_its_mass(target, count):
    found = search(Problem(target), np.random.default_rng(301))
    assert found.coverage.modes == count
    assert abs(found.log_total - target.exact) < 8 * found.sd + 0.05
    assert len(found.clouds) == len(found.weights) == count


def test_a_spike_within_a_slab_is_found_from_within():
    target = SpikeAndSlab(8)
    found = search(Problem(target), np.random.default_rng(302))
    assert found.log_total > target.exact - 1.0


def test_an_edge_is_no_reason_to_find_too_much():
    target = Cut(2)
    found = search(Problem(target), np.random.default_rng(303))
    assert found.beyond(target.exact, 0.01) == 0.0


def test_what_was_covered_is_what_a_point_meets():
    assert (1 - smallest(500)) ** 500 == pytest.approx(0.01)
    target = Modes(2)
    target.points = 512
    found = search(Problem(target), np.random.default_rng(304)).coverage
    assert found.points == 512
    assert found.volume == smallest(512)
    assert found.ascents >= found.modes >= 1


def other_mode(target: Uneven, rng: np.random.Generator) -> np.ndarray:
    return rng.normal(-4.0, 1.0, (4000, target.dimension))


def test_draws_that_miss_the_main_mode_are_told_so():
    target = Uneven(2, 0.02)
    x = other_mode(target, np.random.default_rng(305))
    found = evidence(target, 1, draws=x, effective=4000.0)
    assert found.disagreement is Disagreement.MISSED
    assert found.missed == pytest.approx(np.log(10), abs=0.3)
    all_of_it = Linear([1.0, 0.2])
    precision = all_of_it.a.T @ all_of_it.a + np.eye(2)
    mean = np.linalg.solve(precision, all_of_it.a.T @ all_of_it.y)
    x = np.random.default_rng(306).multivariate_normal(mean, np.linalg.inv(precision), 4000)
    assert bridge(all_of_it, x, effective=4000.0, seed=1).missed == 0.0


def test_nested_sampling_around_draws_that_miss_the_main_mode_is_right():
    target = Uneven(2, 0.02)
    x = other_mode(target, np.random.default_rng(307))
    found = nested(target, 1, 0.3, None, [x])
    assert abs(found.log_evidence - target.exact) < 5 * found.sd


@pytest.mark.parametrize("target", [Uneven(2, 0.02), Uneven(4, 0.1)], ids=["2", "4"])
def test_bridge_sampling_finds_a_main_mode_in_a_tiny_part_of_the_prior(target):
    found = bridge(target, seed=308)
    assert abs(found.log_evidence - target.exact) < 8 * found.sd + 0.01
