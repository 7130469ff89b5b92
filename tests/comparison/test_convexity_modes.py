"""Evidence under every convexity mode, from draws of one of them."""

import numpy as np
import pytest

import bayesmembrane as bm
from bayesmembrane.app.demo import shipped_measurement
from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.comparison.convexity_modes import WITHIN, ByMode, by_convexity
from bayesmembrane.physics.convexity import MODES

KNOWN = 3.0


@pytest.fixture(scope="module")
def rows() -> dict[str, ByMode]:
    """Of Mooney-Rivlin on the first range, which most films fit that are not convex."""
    m, h = shipped_measurement("OP1"), bm.hypothesis("mooney_rivlin")
    posterior = Posterior(h.on(m), m)
    masses = posterior.prior.masses(m)
    masses[WITHIN] = masses["reached"]
    found = by_convexity(posterior, np.asarray(bm.sample(m, h, ess=300.0).draws()), (KNOWN, 0.0), masses)
    return {r.mode: r for r in found}


def test_every_mode_is_answered(rows: dict[str, ByMode]) -> None:
    assert set(rows) == {*MODES, WITHIN}
    assert all(r.missing is None and r.ess >= 100 for r in rows.values())


def test_the_own_mode_keeps_its_evidence(rows: dict[str, ByMode]) -> None:
    own = rows["reached"]
    assert own.log_evidence == pytest.approx(KNOWN - np.log(own.mass))


def test_what_asks_less_has_the_larger_integral(rows: dict[str, ByMode]) -> None:
    """Not yet divided by the mass; of the same draws, so that it holds whatever they are."""
    integral = {name: float(r.log_evidence) + np.log(r.mass) for name, r in rows.items() if r.log_evidence is not None}
    assert integral["box"] <= integral["reached"] <= integral["elliptic"] <= integral["none"]
    assert integral["reached"] <= integral[WITHIN] <= integral["none"]
