"""Evidence of three materials on the shipped data against cubature on a grid of the same coordinates."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.special import logsumexp

from bayesmembrane.app.demo import shipped_measurement
from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.sampling.walk import Settings, run_ensembles
from bayesmembrane.comparison.convexity_modes import by_convexity
from bayesmembrane.comparison.evidence.bridge import bridge
from bayesmembrane.comparison.evidence.nested import nested
from bayesmembrane.comparison.evidence.target import PosteriorTarget, of_fewest_coordinates
from bayesmembrane.comparison.jobs import first_candidates
from bayesmembrane.comparison.prior_widths import prior_widths, scaled
from bayesmembrane.physics.hypothesis import hypothesis
from tests.statistics.cubature import log_evidence

MATERIALS = ("neo_hookean", pytest.param("mooney_rivlin", marks=pytest.mark.study), "gent")


@cache
def posterior(name: str, convexity: str = "reached", range_name: str = "OP1") -> Posterior:
    return Posterior(hypothesis(name, convexity=convexity), shipped_measurement(range_name))


@cache
def exact(name: str, convexity: str = "reached", range_name: str = "OP1") -> float:
    return log_evidence(posterior(name, convexity, range_name))


@cache
def sampled(name: str, convexity: str = "reached", range_name: str = "OP1"):
    found = run_ensembles(posterior(name, convexity, range_name), Settings(ess=400, sampler="emcee"), 211)
    burn = found.convergence.burn
    return found.chains.x[:, burn:], found.chains.log_posterior[:, burn:], float(np.min(found.convergence.ess))


@pytest.mark.parametrize("name", MATERIALS)
def test_the_grid_is_fine_enough(name):
    assert log_evidence(posterior(name), cells=60) == pytest.approx(exact(name), abs=0.005)


@pytest.mark.parametrize(
    ("name", "range_name"),
    [
        *(("neo_hookean", end) for end in ("OP1", "OP2")),
        *(
            pytest.param(name, end, marks=pytest.mark.study)
            for name in ("gent", "mooney_rivlin")
            for end in ("OP1", "OP2")
        ),
    ],
)
def test_bridge_sampling_is_right_within_a_twentieth(name, range_name):
    x, log_posterior, _ = sampled(name, range_name=range_name)
    found = bridge(PosteriorTarget(posterior(name, range_name=range_name)), x, seed=7, log_posterior=log_posterior)
    assert abs(found.log_evidence - exact(name, range_name=range_name)) < 0.05
    assert found.sd < 0.05


@pytest.mark.parametrize("name", MATERIALS)
def test_nested_sampling_is_right_within_three_standard_errors(name):
    found = nested(PosteriorTarget(posterior(name)), 212, tolerance=0.15)
    assert found.sd <= 0.15
    assert abs(found.log_evidence - exact(name)) < 3 * found.sd


@pytest.mark.parametrize(
    ("name", "range_name"), [("gent", "OP1"), ("gent", "OP2"), ("mooney_rivlin", "OP1"), ("mooney_rivlin", "OP2")]
)
def test_the_shape_alone_has_the_evidence_of_all_coordinates(name, range_name):
    target = of_fewest_coordinates(posterior(name, range_name=range_name))
    assert target.dimension == 1
    u = (np.arange(4000) + 0.5) / 4000
    found = target.evaluate(target.prior_transform(u[:, None])).log_likelihood
    assert logsumexp(found) - np.log(u.size) == pytest.approx(exact(name, range_name=range_name), abs=0.01)


# Films that are not convex take long to be solved: "elliptic" allows many, and "none" all.
@pytest.mark.study
@pytest.mark.parametrize("solved", [{"reached", "box"}, {"elliptic"}])
def test_evidence_under_another_mode_comes_from_the_draws_of_one(solved):
    """Where a mode is not answered, it is said why; where it is, cubature agrees."""
    p = posterior("mooney_rivlin", range_name="OP2")
    x, _, _ = sampled("mooney_rivlin", range_name="OP2")
    masses = p.prior.masses(p.measurement, 213)
    known = exact("mooney_rivlin", range_name="OP2")
    first = first_candidates(p, 1)
    rows = {r.mode: r for r in by_convexity(p, x.reshape(-1, x.shape[-1]), (known, 0.0), masses, first, 1)}
    assert rows["reached"].log_evidence == pytest.approx(known - np.log(masses["reached"].value))
    answered = [m for m, r in rows.items() if r.missing is None]
    assert "reached" in answered
    for mode in solved & set(answered):
        wanted = exact("mooney_rivlin", mode, "OP2") - np.log(masses[mode].value)
        assert abs(rows[mode].log_evidence - wanted) < 3.5 * rows[mode].sd + 0.02
    # Whatever else is allowed adds to the integral that is not yet divided by the mass.
    integral = {m: rows[m].log_evidence + np.log(rows[m].mass) for m in answered}
    assert integral.get("box", -np.inf) <= integral["reached"] + 1e-9
    assert integral.get("none", np.inf) >= integral["reached"] - 1e-9


@pytest.mark.study
@pytest.mark.parametrize("name", ["gent", "mooney_rivlin"])
def test_prior_widths_agree_with_priors_of_that_width(name):
    """The reweighted change is that of the two cubatures, with the mass of either prior.

    Twice the width uses the tail of the draws: whether it can be answered is up to them. What is answered is right
    within eight stated errors, which no seed and no machine should miss: tests/comparison/test_prior_widths.py.
    """
    p = posterior(name)
    x, _, worth = sampled(name)
    # All draws: twice the width uses the tail, where they are few.
    widths = {(w.parameter, w.factor): w for w in prior_widths(p, x.reshape(-1, x.shape[-1]), worth, seed=214)}
    parameter = p.hypothesis.parameters[1]
    for factor in (0.5, 2.0):
        coordinates = list(p.hypothesis.material.coordinates)
        coordinates[1] = replace(coordinates[1], prior=scaled(coordinates[1].prior, factor))
        kind = p.hypothesis.material
        same = {"__qualname__": kind.__qualname__, "source_text": kind.source_text}
        other = type(kind.__name__, (kind,), {"coordinates": tuple(coordinates), **same})
        wide = Posterior(replace(p.hypothesis, material=other), p.measurement)
        masses = [q.prior.masses(p.measurement, 215)["reached"] for q in (wide, p)]
        change = log_evidence(wide) - exact(name) - np.log(masses[0].value / masses[1].value)
        error = np.hypot(*(m.sd / m.value for m in masses))
        found = widths[parameter.name, factor]
        if factor > 1 and found.unknown is not None:
            assert np.isnan(found.change)
            continue
        assert found.unknown is None
        assert found.sd < (0.2 if factor < 1 else 0.5)
        assert abs(found.change - change) < 8 * np.hypot(found.sd, error) + 0.01
    assert widths[parameter.name, 1.0].change == 0.0
