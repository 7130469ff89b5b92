"""Predictions say what the draws say, and are stored with them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.calibration.beside_paper import BreakPoint
from bayesmembrane.calibration.prediction_store import FILE
from bayesmembrane.calibration.predictions import Predictions, Wanted, predict_draws
from bayesmembrane.calibration.run import (
    Run,
    RunSettings,
    has_predictions,
    load_run,
    predictions_of,
    sample,
    stored_predictions,
)
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.materials.gent import Gent
from bayesmembrane.physics.mechanics import request, solve
from bayesmembrane.physics.mechanics.api import force_curve
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.biaxial import Biaxial

AT = np.linspace(0.004, 0.030, 7)
SD = 5e-3


def measured(**changes: object) -> Measurement:
    force = force_curve("gent", (7.5, 40.0), AT)[0]
    arguments: dict[str, object] = {"force_sd": np.full(AT.size, SD), "full_range": 0.04, **changes}
    return Measurement(AT, force, Annulus(0.010, 0.035), Specimen("film", 50e-6), **arguments)  # type: ignore[arg-type]


def gent(limits: list[float], noise: float = -20.0) -> np.ndarray:
    """Coordinates of Gent films of one modulus with these limits of I1 - 3."""
    return np.array([[np.log(15.0), np.log(jm), noise] for jm in limits])


def made(x: np.ndarray, **options: object) -> Predictions:
    return predict_draws(hypothesis("gent"), measured(), x, Wanted(**options))  # type: ignore[arg-type]


def test_bands_are_quantiles_of_the_curves_and_the_end_of_the_fit_is_on_the_grid() -> None:
    found = made(gent([40.0] * 8), up_to=0.05)
    assert found.deflection[-1] == pytest.approx(0.05)
    assert np.any(np.isclose(found.deflection, 0.030, rtol=1e-12))
    assert np.array_equal(found.beyond, found.deflection > 0.030 * (1 + 1e-9))
    exact = force_curve("gent", (7.5, 40.0), found.deflection)[0]
    np.testing.assert_allclose(found.curve, np.broadcast_to(exact, found.curve.shape), rtol=1e-6)
    np.testing.assert_allclose(found.residual, 0.0, atol=1e-6)


def test_bands_hold_the_truth_and_widen_beyond_the_fit() -> None:
    """A film that is shot, fitted over two thirds of the range by the other solver."""

    def shot(at: np.ndarray) -> np.ndarray:
        return solve(request(Gent, [5.3, 14.0], at, 0.010, 0.035, solver="shooting")).force[0]

    at = np.linspace(5e-3, 0.09, 14)
    force = shot(at) + 0.02 * np.random.default_rng(8).standard_normal(at.size)
    part = Measurement(at, force, Annulus(0.010, 0.035), Specimen("film", 50e-6)).up_to(0.06)
    claim = hypothesis("gent")
    found = predict_draws(claim, part, sample(part, claim, RunSettings(seed=5, ess=300)).draws())
    low, middle, high = found.curve
    truth, inner = shot(found.deflection), ~found.beyond
    sd = (high - low) / (2 * 1.645)
    assert np.all(np.abs(truth - middle)[inner] < 3 * sd[inner])
    assert np.all((found.repeat[0][inner] <= low[inner]) & (high[inner] <= found.repeat[2][inner]))
    width = (high - low) / middle
    assert width[-1] > 3 * np.max(width[inner][-5:])


def test_a_new_measurement_carries_the_stated_noise_and_the_inferred_one() -> None:
    bare = made(gent([40.0] * 400))
    width = (bare.repeat[2] - bare.repeat[0]) / (2 * 1.645)
    assert np.mean(width) == pytest.approx(SD, rel=0.1)
    scale = float(np.max(measured().force))
    more = made(gent([40.0] * 400, noise=float(np.log(0.02 / scale))))
    assert np.mean((more.repeat[2] - more.repeat[0]) / (2 * 1.645)) == pytest.approx(np.hypot(SD, 0.02), rel=0.1)


def test_draws_that_lock_are_counted_by_reason_and_bands_end_where_most_have_no_force() -> None:
    found = made(gent([200.0] * 4 + [9.0] * 6), up_to=0.09)
    assert found.reasons == ("locked",)
    assert found.lost_share[0] == 0.0
    assert found.lost_share[-1] == pytest.approx(0.6)
    assert np.all(np.isnan(found.curve[:, -1]))
    assert np.all(np.isfinite(found.curve[:, ~found.beyond]))


def test_thickness_scales_the_force_at_break() -> None:
    breaks = tuple(BreakPoint(n, t, d, 1.0) for n, t, d in (("a", 50e-6, 0.03), ("b", 200e-6, 0.03), ("c", 50e-6, 0.2)))
    found = made(gent([40.0] * 3), breaks=breaks)
    assert found.break_predicted[1, 1] == pytest.approx(4 * found.break_predicted[1, 0])
    assert found.break_lost.tolist() == [0.0, 0.0, 1.0]
    assert np.all(np.isnan(found.break_predicted[:, 2]))
    assert found.specimens == ("a", "b", "c")


def test_points_that_were_not_used_are_compared_with_predicted_measurements() -> None:
    at = np.array([0.034, 0.040])
    force = force_curve("gent", (7.5, 40.0), at)[0]
    rest = Measurement(at, force, Annulus(0.010, 0.035), Specimen("film", 50e-6), None, np.full(2, SD))
    found = made(gent([40.0] * 400), rest=rest)
    assert np.all(found.rest_residual[0] < 0)
    assert np.all(found.rest_residual[2] > 0)
    np.testing.assert_allclose((found.rest_residual[2] - found.rest_residual[0]) / (2 * 1.645), SD, rtol=0.2)


@pytest.mark.parametrize("noise", ["form", "form_ar1"])
def test_form_errors_reach_points_that_are_scattered_over_a_path(noise: str) -> None:
    """Of a sheet up to one stretch the rest lies here and there among all readings; each has its own form error."""
    x = 0.05 * np.tile(np.linspace(0.1, 1.0, 8), 2)
    across = np.concatenate([1 + 0.5 * x[:8] / 0.05, 1 + 2 * x[8:] / 0.05])
    sheet = Measurement(x, np.linspace(1.0, 5.0, 16), Biaxial(), Specimen("sheet", 1e-4), across=across)
    some = x <= 0.03
    claim = hypothesis("neo_hookean", noise=noise)
    theta = np.array([[np.log(30.0), -7.0, np.log(0.05), 0.0][: 2 + len(claim.noise.coordinates) - 1]] * 50)
    found = predict_draws(claim, sheet.select(some), theta, Wanted(rest=sheet.select(~some)))
    assert found.rest_residual.shape == (3, np.count_nonzero(~some))
    assert np.all(found.rest_residual[2] > found.rest_residual[0])


def test_states_shapes_and_map_belong_to_the_film() -> None:
    found = made(gent([40.0] * 5))
    assert found.film == pytest.approx([7.5, 40.0])
    assert found.shape_at.tolist() == pytest.approx([0.01, 0.02, 0.03, 0.04])
    assert np.all(found.map_1[0] < found.state_1) and np.all(found.state_1 < found.map_1[-1])  # noqa: PT018
    np.testing.assert_allclose(found.shape_radius[:, :, [0, -1]], np.broadcast_to([0.010, 0.035], (4, 5, 2)))
    np.testing.assert_allclose(found.shape_height[:, :, 0], np.repeat(found.shape_at[:, None], 5, axis=1))
    assert found.convex == {"reached": 1.0, "box": 1.0, "elliptic": 1.0}
    assert np.nanmin(found.eigenvalue) > 0


SHORT = Settings(ess=1.0, chunk=30, most_steps=30, walkers=16)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    out = tmp_path_factory.mktemp("chains")
    return sample(measured(), hypothesis("neo_hookean"), RunSettings(out=out, settings=SHORT, predictions=False))


def assert_same(a: Predictions, b: Predictions) -> None:
    for name, value in vars(a).items():
        if isinstance(value, np.ndarray):
            np.testing.assert_array_equal(value, getattr(b, name), err_msg=name)
            assert value.dtype == getattr(b, name).dtype, name
        else:
            assert getattr(b, name) == value, name


def test_stored_predictions_equal_those_that_were_computed(run: Run) -> None:
    assert stored_predictions(run) is None
    assert not has_predictions(run)
    fresh = predictions_of(run, Wanted(breaks=(BreakPoint("1", 100e-6, 0.02, 1.0),), draws=10))
    again = stored_predictions(run)
    assert again is not None
    assert has_predictions(run)
    assert_same(fresh, again)


def test_a_finished_run_has_its_predictions_whoever_made_it(run: Run, tmp_path: Path) -> None:
    at = np.array([0.034, 0.040])
    rest = Measurement(at, force_curve("gent", (7.5, 40.0), at)[0], Annulus(0.010, 0.035), Specimen("film", 50e-6))
    done = sample(measured(), hypothesis("neo_hookean"), RunSettings(out=tmp_path, settings=SHORT, rest=rest))
    found = stored_predictions(done)
    assert found is not None
    assert found.rest_at.tolist() == at.tolist()
    assert_same(found, predict_draws(done.hypothesis, done.measurement, done.draws(), Wanted(rest=rest)))
    assert done.path is not None
    (done.path / FILE).unlink()
    assert predictions_of(load_run(done.path)).rest_at.size == 0
    assert (done.path / FILE).is_file()
    assert_same(predictions_of(run, Wanted()), predict_draws(run.hypothesis, run.measurement, run.draws()))


def test_other_questions_are_computed_anew_and_none_reads_back(run: Run) -> None:
    predictions_of(run, Wanted(up_to=0.06, draws=10))
    assert predictions_of(run).deflection[-1] == pytest.approx(0.06)
    assert predictions_of(run, Wanted(up_to=0.05, draws=10)).deflection[-1] == pytest.approx(0.05)
    assert predictions_of(run).deflection[-1] == pytest.approx(0.05)


def test_predictions_of_other_draws_do_not_count(run: Run) -> None:
    predictions_of(run, Wanted(up_to=0.05, draws=10))
    other = Run(run.name, run.path, run.settings, {**run.status, "evaluations": 1}, run.data)
    assert stored_predictions(other) is None
    assert not has_predictions(other)


@pytest.mark.parametrize("asked", [stored_predictions, has_predictions])
def test_damaged_predictions_are_named(asked: Callable[[Run], object], run: Run, tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(b"no netCDF")
    with pytest.raises(StorageError, match=r"the file of predictions is damaged"):
        asked(Run(run.name, tmp_path, run.settings, run.status, run.data))
