"""Evidence under every convexity mode, from draws of one of them, beside quadrature over the shape that is drawn."""

import numpy as np
import pytest

import bayesmembrane as bm
from bayesmembrane.app.demo import shipped_measurement
from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.comparison.convexity_modes import WITHIN, ByMode, _Target, _Weighted, by_convexity
from bayesmembrane.comparison.jobs import first_candidates
from bayesmembrane.physics.convexity import MODES

KNOWN, FAR, POINTS = 3.0, 40.0, 4001


@pytest.fixture(scope="module")
def posterior() -> Posterior:
    """Of Mooney-Rivlin on the first range, which most films fit that are not convex."""
    m = shipped_measurement("OP1")
    return Posterior(bm.hypothesis("mooney_rivlin").on(m), m)


@pytest.fixture(scope="module")
def rows(posterior: Posterior) -> dict[str, ByMode]:
    masses = posterior.prior.masses(posterior.measurement)
    masses[WITHIN] = masses["reached"]
    run = bm.sample(posterior.measurement, posterior.hypothesis, ess=300.0)
    first = first_candidates(posterior, 0)
    return {r.mode: r for r in by_convexity(posterior, np.asarray(run.draws()), (KNOWN, 0.0), masses, first)}


@pytest.fixture(scope="module")
def exact(posterior: Posterior) -> dict[str, float]:
    """ln of the integral under each mode over that of the own one, modulus and noise integrated out."""
    target = _Target.of(posterior, posterior.hypothesis.convexity)
    assert target.size == 1
    rough = np.linspace(-9.0, 9.0, 1001)
    log_p, _ = target.solved(rough[:, None])
    some = rough[log_p > np.max(log_p) - FAR]
    log_p, inside = target.solved(np.linspace(some[0] - 0.02, some[-1] + 0.02, POINTS)[:, None])
    p = np.exp(log_p - np.max(log_p))
    return {mode: float(np.log(np.sum(p[met]) / np.sum(p[inside["reached"]]))) for mode, met in inside.items()}


def test_every_mode_is_answered(rows: dict[str, ByMode]) -> None:
    assert set(rows) == {*MODES, WITHIN}
    assert all(r.missing is None and r.ess >= 100 for r in rows.values())


def test_the_own_mode_keeps_its_evidence(rows: dict[str, ByMode]) -> None:
    own = rows["reached"]
    assert own.log_evidence == pytest.approx(KNOWN - np.log(own.mass))


def test_draws_equal_quadrature(rows: dict[str, ByMode], exact: dict[str, float]) -> None:
    """Within five standard errors, of which those of the masses are none: they are the same on both sides."""
    for mode, r in rows.items():
        assert r.log_evidence is not None
        assert r.sd is not None
        ratio = r.log_evidence + np.log(r.mass) - KNOWN
        assert abs(ratio - exact[mode]) < 5 * r.sd + 0.01, mode


def test_draws_none_of_which_has_a_weight_are_worth_nothing() -> None:
    none = np.full(3, -np.inf)
    assert _Weighted(np.zeros((3, 1)), none, {"reached": np.ones(3, dtype=bool)}).ess("reached") == 0.0
