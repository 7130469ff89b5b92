"""How far off both estimators are, in units of the errors they state: twenty seeds, a table in docs/studies.

python -m pytest -m study tests/statistics/test_evidence_study.py
"""

from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.app.demo import shipped_measurement
from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.comparison.evidence.bridge import bridge
from bayesmembrane.comparison.evidence.nested import nested
from bayesmembrane.comparison.evidence.target import PosteriorTarget
from bayesmembrane.physics.hypothesis import hypothesis
from tests.statistics.cubature import log_evidence
from tests.statistics.evidence_targets import Banana, Cut, Funnel, Linear, Modes, NormalGamma, Shells, Tails

SEEDS = range(20_000, 20_020)
TABLE = Path(__file__).parents[2] / "docs" / "studies" / "evidence_calibration.md"
WORST = 1.5

SYNTHETIC = {
    "linear, k = 4, condition 1e5": lambda: Linear([1.0, 0.3, 0.05, 0.003]),
    "normal-gamma, k = 2": NormalGamma,
    "two modes, k = 2": lambda: Modes(2),
    "two shells, k = 3": lambda: Shells(3),
    "banana, k = 2": lambda: Banana(2),
    "heavy tails, k = 4": lambda: Tails(4),
    "funnel, k = 4": lambda: Funnel(4),
    "cut prior, k = 5": lambda: Cut(5),
}
# With the cells of the grid that gives the exact value: convexity cuts the posterior of Mooney-Rivlin, and midpoints
# meet the edge of a cut only to the first order.
MATERIALS = {"neo_hookean": 120, "gent": 120, "mooney_rivlin": 360}
ESTIMATORS = {"bridge": lambda target, seed: bridge(target, seed=seed), "nested": nested}


def film(name: str) -> PosteriorTarget:
    target = PosteriorTarget(Posterior(hypothesis(name), shipped_measurement("OP1")))
    object.__setattr__(target, "exact", log_evidence(target.posterior, MATERIALS[name]))
    return target


def row(name: str, estimator: str, target) -> tuple[str, float]:
    found = [ESTIMATORS[estimator](target, seed) for seed in SEEDS]
    error = np.array([f.log_evidence for f in found]) - target.exact
    sd = np.array([f.sd for f in found])
    z = float(np.sqrt(np.mean((error / sd) ** 2)))
    cells = [
        name,
        estimator,
        f"{target.exact:.3f}",
        f"{np.mean(error):+.4f}",
        f"{np.sqrt(np.mean(error**2)):.4f}",
        f"{np.sqrt(np.mean(sd**2)):.4f}",
        f"{z:.2f}",
        f"{np.sum(np.abs(error) <= 2 * sd)}",
        f"{np.mean([f.evaluations for f in found]):.0f}",
        f"{np.mean([f.seconds for f in found]):.1f}",
    ]
    return f"| {' | '.join(cells)} |", z


@pytest.mark.study
def test_stated_errors_are_the_errors_made():
    targets = {name: make() for name, make in SYNTHETIC.items()}
    targets |= {f"{name}, 35.1 mm": film(name) for name in MATERIALS}
    rows = {(name, e): row(name, e, target) for name, target in targets.items() for e in ESTIMATORS}
    TABLE.parent.mkdir(parents=True, exist_ok=True)
    TABLE.write_text(HEAD + "\n".join(text for text, _ in rows.values()) + "\n", encoding="utf-8")
    worst = {key: z for key, (_, z) in rows.items() if z > WORST}
    assert not worst, f"standardised errors above {WORST}: {worst}"


HEAD = f"""# How far off the evidence estimators are

`make study` or `python -m pytest -m study tests/statistics/test_evidence_study.py` writes this table. Each row:
{len(SEEDS)} runs with the seeds {SEEDS.start} to {SEEDS.stop - 1}, on a problem whose ln Z is known in closed form, by
quadrature in one dimension, or (films) by cubature on a grid of the same coordinates. Bridge sampling makes its own
draws here.

rms z: root mean square of (estimate - exact) / stated standard error; 1 is honest, above {WORST} fails. Within 2: how
many of the {len(SEEDS)} errors are at most two stated standard errors. Seconds on one core of a shared machine.

| problem | estimator | exact ln Z | mean error | rms error | stated sd | rms z | within 2 | evaluations | seconds |
|---|---|---|---|---|---|---|---|---|---|
"""
