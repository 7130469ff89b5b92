"""Joint least squares: the optimum of all tests, each by its own noise."""

import numpy as np
import pytest
from scipy.optimize import minimize

from bayesmembrane.calibration.fit import fit
from bayesmembrane.calibration.joint.claim import Joint, joint
from bayesmembrane.calibration.joint.fit import fit_jointly
from bayesmembrane.calibration.joint.objective import JointObjective
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.planar import Planar
from tests.calibration.joint.tests_of import SHEET, STRIP, made

MR = (8.0, 2.0)


def test_noiseless_tests_give_back_the_truth_in_the_thinnest_film() -> None:
    tests = [
        made(STRIP, "yeoh", (9.0, -0.2, 0.02), noise=0.0, thickness=4e-4),
        made(SHEET, "yeoh", (9.0, -0.2, 0.02), noise=0.0),
    ]
    found = fit_jointly(joint(tests, hypothesis("yeoh")))
    np.testing.assert_allclose([v for v, _ in found.parameters.values()], (9.0, -0.2, 0.02), rtol=1e-4)
    thick = found.parts[0].parameters
    np.testing.assert_allclose([thick[n] for n in ("c1", "c2", "c3")], (36.0, -0.8, 0.08), rtol=1e-4)


def test_one_test_with_a_stated_noise_is_its_weighted_fit() -> None:
    m = made(STRIP, "mooney_rivlin", MR, seed=3)
    claim = hypothesis("mooney_rivlin")
    one, alone = fit_jointly(joint([m], claim)), fit(m, claim, loss="weighted")
    assert one.objective == pytest.approx(alone.objective, rel=1e-6)
    assert {n: one.summary()[n] for n in ("rmse_N", "loss_N")} == pytest.approx(
        {"rmse_N": alone.rmse_N, "loss_N": alone.loss_N}, rel=1e-6
    )
    assert one.summary()["status"] == "converged"
    for name, (value, sd) in one.parameters.items():
        other = alone.parameters[f"mooney_rivlin.{name}"]
        assert value == pytest.approx(other.value, rel=1e-3)
        assert sd == pytest.approx(other.sd, rel=1e-2)


def test_two_tests_are_weighed_by_their_noises_as_another_optimiser_does() -> None:
    tests = {
        "a": made(STRIP, "mooney_rivlin", MR, seed=3, noise=0.002),
        "b": made(SHEET, "mooney_rivlin", MR, seed=4, noise=0.05),
    }
    claim = hypothesis("mooney_rivlin")
    found = fit_jointly(joint(tests, claim))

    def loss(c: np.ndarray) -> float:
        total = 0.0
        for m in tests.values():
            force = Forward(claim, m, m.deflection).film_force(c[None, :])[0]
            assert m.force_sd is not None
            total += float(np.sum(((force - m.force) / m.force_sd) ** 2))
        return total

    best = minimize(loss, MR, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12, "maxiter": 4000})
    assert found.objective**2 == pytest.approx(best.fun, rel=1e-7)
    np.testing.assert_allclose([v for v, _ in found.parameters.values()], best.x, rtol=1e-4)


def test_a_test_without_a_stated_noise_is_weighed_by_its_residual() -> None:
    quiet = made(STRIP, "neo_hookean", (10.0,), seed=1, noise=0.002, stated=False)
    loud = made(STRIP, "neo_hookean", (10.0,), seed=2, noise=0.1, stated=False, specimen="loud")
    found = fit_jointly(joint([quiet, loud], hypothesis("neo_hookean")))
    for part in found.parts:
        assert not part.stated
        assert part.noise_N == pytest.approx(part.rmse_N, rel=1e-3)
    alone = fit(quiet, hypothesis("neo_hookean")).parameters["neo_hookean.c1"].value
    assert found.parameters["c1"][0] == pytest.approx(alone, rel=2e-3)


def test_a_thickness_is_found_in_one_test_where_another_fixes_the_modulus() -> None:
    true = made(STRIP, "neo_hookean", (10.0,), noise=0.0, stated=False)
    wrong = made(SHEET, "neo_hookean", (11.0,), noise=0.0, stated=False, specimen="sheet")
    claims = {"strip": hypothesis("neo_hookean"), "sheet": hypothesis("neo_hookean", ["thickness"])}
    found = fit_jointly(joint({"strip": true, "sheet": wrong}, claims))
    assert found.parameters["sheet.thickness.error"][0] == pytest.approx(0.1, rel=1e-3)
    assert found.parameters["c1"][0] == pytest.approx(10.0, rel=1e-4)


def test_the_order_of_the_tests_does_not_matter() -> None:
    parts = joint(
        {"a": made(STRIP, "mooney_rivlin", MR, seed=3), "b": made(SHEET, "mooney_rivlin", MR, seed=4)},
        hypothesis("mooney_rivlin", ["zero_offset"]),
    ).parts
    one, other = fit_jointly(Joint(parts)), fit_jointly(Joint(parts[::-1]))
    for name, (value, _) in one.parameters.items():
        assert other.parameters[name][0] == pytest.approx(value, rel=1e-4, abs=1e-8)


def test_a_long_test_is_fitted_with_all_its_readings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bayesmembrane.calibration.joint.objective.MANY", 60)
    long = made(STRIP, "mooney_rivlin", MR, seed=1, points=400, noise=0.01)
    short = made(SHEET, "mooney_rivlin", MR, seed=2, specimen="sheet")
    found = fit_jointly(joint([long, short], hypothesis("mooney_rivlin")))
    assert found.parts[0].force.size == 400
    # Standard errors of 400 readings: the values are within six of them.
    for (value, sd), truth in zip(found.parameters.values(), MR, strict=True):
        assert sd is not None
        assert abs(value - truth) < 6 * sd
        assert sd < 0.2


def test_of_several_maxima_the_highest_is_found() -> None:
    """A neo-Hookean film follows one mode or another of a rubber that stiffens: as high as anywhere on a grid."""
    rubber = (63.0, 0.12, -1.0, 1.3, 5.0, -2.0)  # N/m: Ogden's of 1972 in a film 0.1 mm thick
    modes = ((STRIP, 0.33, 24), (Planar(), 0.06, 14), (SHEET, 0.17, 17))
    tests = {rig.name: made(rig, "ogden", rubber, top=top, points=n, noise=0.0) for rig, top, n in modes}
    both = joint(tests, hypothesis("neo_hookean", convexity="none"))
    found, objective = fit_jointly(both), JointObjective(both)

    def log_likelihood(ln_gd: float) -> float:
        noises = objective.inferred(np.array([ln_gd]))
        return -float(np.sum(objective.sizes * np.log(noises)))

    grid = [log_likelihood(x) for x in np.log(np.linspace(20.0, 70.0, 201))]
    assert log_likelihood(float(found.coordinates[0])) >= max(grid) - 1e-3
