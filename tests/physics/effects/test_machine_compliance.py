"""The frame that a blank run shows: recovered from other laws, with an error that holds, and no longer in question."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.calibration.fit import fit
from bayesmembrane.calibration.layout import laid_out, measurement_of
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.diagnosis.diagnose import diagnose
from bayesmembrane.diagnosis.explanation.case import Question
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.physics.effects.machine_compliance import MachineCompliance
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import Hypothesis, from_settings, hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.valleys.beside import valleys_beside
from bayesmembrane.valleys.follow import valleys_of
from bayesmembrane.words.diagnosis import document
from bayesmembrane.words.hypothesis import spoken
from tests.generator.datasets import generate
from tests.generator.distortions import give

MOST = 2.0  # N


def yielding(force: np.ndarray, softening: float = 0.2) -> np.ndarray:
    """m: a spring whose stiffness changes with the load, by a polynomial, which is no law of the library."""
    part = force / MOST
    return np.asarray(3e-4 * part * (1 + softening * part) / (1 + softening))


def run(rng: np.random.Generator, noise: float, softening: float = 0.2) -> np.ndarray:
    """(80, 2) m and N: up and down, the dummy seated 20 um late."""
    force = MOST * np.concatenate([np.linspace(0.01, 1, 40), np.linspace(1, 0.01, 40)])
    travel = 2e-5 + yielding(force, softening) + noise * rng.standard_normal(80)
    return np.column_stack([travel, force])


def measured_with(blank: np.ndarray | None, force: np.ndarray | None = None) -> Measurement:
    lift = np.linspace(1e-3, 20e-3, 12)
    pull = MOST * (lift / lift[-1]) ** 2 if force is None else force
    return Measurement(lift, pull, Annulus(0.010, 0.035), Specimen("film", 5e-5), blank_run=blank)


def frame(h: Hypothesis) -> MachineCompliance:
    (found,) = h.effects
    assert isinstance(found, MachineCompliance)
    return found


LAWS = {
    "a spring that changes": yielding,
    "a logarithm": lambda force: 1e-4 * np.log1p(force / 0.3),
    "a spring and a seat": lambda force: 2e-5 * force + 3e-5 * (1 - np.exp(-force / 0.2)),
}


@pytest.mark.parametrize("law", LAWS)
def test_the_frame_of_a_blank_run_yields_as_the_run_does(law: str) -> None:
    """Whatever its curve: none of these is a law of the library."""
    force = MOST * np.concatenate([np.linspace(0, 1, 60), np.linspace(1, 0, 60)])
    blank = np.column_stack([2e-5 + LAWS[law](force), force])
    found = frame(hypothesis("gent").with_frame(measured_with(blank)))
    asked = np.array([[0.1, 0.5, 1.0, 2.0]])
    x = np.array([[found.coordinates[0].prior.mean_sd[0]]])
    lost, slope = found.yielding(x, asked, 0 * asked)
    assert lost == pytest.approx(LAWS[law](asked), rel=0.02)
    assert found.yielding(x, -asked, 0 * asked)[0] == pytest.approx(-lost)
    step = 1e-7
    assert slope == pytest.approx((found.yielding(x, asked - step, 0 * asked)[0] - lost) / -step, rel=1e-3)


def test_the_error_of_a_blank_run_holds() -> None:
    """Of 400 runs with scatter of 5 um: the travel lost at the largest force lies within 1.96 standard deviations in
    more than 90 %, of which less have a probability below 1e-5 if it is 95 %.
    """
    rng, inside = np.random.default_rng(11), 0
    force = np.concatenate([[0.0] * 10, np.linspace(0.05, MOST, 30)])
    for _ in range(400):
        exponent = float(np.clip(rng.normal(0.8, 0.16), 0.4, 1.3))
        travel = 3e-4 * (force / MOST) ** exponent + 2e-5 + 5e-6 * rng.standard_normal(40)
        found = frame(hypothesis("gent").with_frame(measured_with(np.column_stack([travel, force]))))
        mean, sd = found.coordinates[0].prior.mean_sd
        inside += abs(MOST * mean - 3e-4) < 1.96 * MOST * sd
    assert inside / 400 > 0.90


def test_the_error_of_a_loop_does_not_fall_with_the_number_of_readings() -> None:
    sds = []
    for count in (40, 400, 4000):
        force = MOST * np.concatenate([np.linspace(0, 1, count), np.linspace(1, 0, count)])
        travel = 1e-3 * force + np.where(np.arange(2 * count) < count, 0.0, 1e-4) * np.sin(np.pi * force / MOST)
        found = frame(hypothesis("gent").with_frame(measured_with(np.column_stack([travel, force]))))
        sds.append(found.coordinates[0].prior.mean_sd[1] * MOST)
    assert sds == pytest.approx([sds[0]] * 3, rel=0.2)
    assert 2e-5 < sds[0] < 5e-5


@pytest.mark.parametrize("travel", [np.zeros(30), np.full(30, 5e-4), 1e-6 * np.random.default_rng(5).normal(size=30)])
def test_a_rigid_frame_is_one_that_hardly_yields(travel: np.ndarray) -> None:
    force = np.linspace(0.05, MOST, 30)
    m = measured_with(np.column_stack([travel, force]))
    claim = hypothesis("neo_hookean").with_frame(m)
    assert 0 < frame(claim).coordinates[0].prior.mean_sd[0] * MOST < 2e-6
    assert frame(claim).coordinates[0].bounds[0] == 0
    plain = Forward(hypothesis("neo_hookean"), m, m.deflection)(np.array([[2.0]])).force
    held = Forward(claim.held, m, m.deflection)(np.array([[2.0]])).force
    assert held == pytest.approx(plain, rel=1e-3)


def test_a_few_readings_in_any_order_are_a_curve() -> None:
    force = np.array([1.9, 1.5, 2.0, 1.7])
    found = frame(hypothesis("gent").with_frame(measured_with(np.column_stack([1e-4 * force + 3e-5, force]))))
    lost, _ = found.yielding(np.array([[1e-4]]), np.array([[0.5, 2.0]]), np.zeros((1, 2)))
    assert lost == pytest.approx(np.array([[0.5e-4, 2e-4]]), rel=0.05)


def test_play_and_another_way_back_make_the_error_larger() -> None:
    blank = run(np.random.default_rng(3), 1e-6)
    loose = blank + np.outer(np.where(np.arange(80) < 40, 0.0, 3e-5), [1.0, 0.0])
    sd = [
        frame(hypothesis("gent").with_frame(measured_with(b))).coordinates[0].prior.mean_sd[1] for b in (blank, loose)
    ]
    assert sd[1] > 3 * sd[0]


def test_a_known_frame_is_claimed_once_and_has_no_value_at_which_it_is_not_there() -> None:
    m = measured_with(run(np.random.default_rng(5), 1e-6))
    claim = hypothesis("gent").with_frame(m)
    assert claim.with_frame(m) is claim
    assert claim.on(m) is claim
    assert hypothesis("gent", ["machine_compliance"]).on(m) == claim
    assert claim.known_coordinates == {"machine_compliance.compliance"}
    assert claim.held.parameters == hypothesis("gent").parameters
    assert claim.held.held == claim.held.on(m) == claim.held
    assert [p.null for p in frame(claim).coordinates] == [None]
    assert frame(claim).null == pytest.approx([frame(claim).coordinates[0].prior.mean_sd[0]])
    assert spoken(claim) == "Gent with the frame of its blank run"
    plain = replace(m, blank_run=None)
    assert hypothesis("gent").with_frame(plain) == hypothesis("gent")
    for other in (hypothesis("gent", ["machine_compliance"]), claim, claim.held):  # no frame of another rig
        assert len(frame(other.on(plain)).coordinates) == len(MachineCompliance.coordinates)


def test_a_stored_run_knows_the_frame() -> None:
    m = measured_with(run(np.random.default_rng(5), 1e-6))
    back = measurement_of(laid_out(m))
    assert back.data_hash == m.data_hash
    claim = hypothesis("gent").with_frame(m)
    assert from_settings(claim.settings()).on(back) == claim


def test_what_a_blank_run_shows_is_not_asked_of_the_film(tmp_path: Path) -> None:
    """The generator's film on its own frame, whose stiffness changes with the load, and a run of that frame alone."""
    data = generate("machine_compliance", "neo_hookean", "staircase", strength=1.5, seed=61)
    rng, top = np.random.default_rng(7), float(np.max(data.force_N))
    force = top * np.concatenate([np.linspace(0.02, 1, 30), np.linspace(1, 0.02, 30)])
    lost = give(data.at_work["machine_compliance"], force)
    blank = np.column_stack([lost + 1e-6 * rng.standard_normal(60), force])
    m = replace(read_measurement(*data.write(tmp_path)), blank_run=blank)
    found = diagnose(m, Question(hypothesis("neo_hookean"), declared=True))
    assert found.verdict == "adequate"
    assert found.probabilities.effects["none"] > 0.95
    assert found.null.names == ("machine_compliance",)
    assert document(found)["effects"] == []
    fitted, plain = fit(m, hypothesis("neo_hookean")), fit(replace(m, blank_run=None), hypothesis("neo_hookean"))
    assert fitted.rmse_N < 0.8 * plain.rmse_N
    assert fitted.at_bound == ()
    value, sd = fitted.hypothesis.effects[0].size.prior.mean_sd
    shown = fitted.parameters["machine_compliance.compliance"]
    assert (shown.value, shown.sd) == (pytest.approx(value), pytest.approx(sd, rel=0.2))
    truth, c1 = data.truth["parameters"]["c1"], fitted.parameters["neo_hookean.c1"]
    assert c1.sd is not None
    assert abs(c1.value - truth) < 4.4 * c1.sd
    assert abs(plain.parameters["neo_hookean.c1"].value - truth) > 10 * c1.sd


def test_a_valley_holds_the_frame_and_takes_the_draws_of_a_run_that_has_it() -> None:
    claim, plain = hypothesis("neo_hookean"), measured_with(run(np.random.default_rng(5), 1e-6))
    whole = claim.with_frame(plain)
    rng, at = np.random.default_rng(2), np.array([2.9, whole.parameters[1].prior.mean_sd[0], -6.0])
    force = Forward(whole, plain, plain.deflection)(at[None, :2]).force[0]
    m = replace(plain, force=force + 1e-3 * rng.standard_normal(force.size))
    draws = at + np.array([1e-3, whole.parameters[1].prior.mean_sd[1], 0.1]) * rng.standard_normal((400, 3))
    found = valleys_of([m], claim, draws=[draws])
    assert found.ranges[0].hypothesis.held.parameters == claim.parameters
    with pytest.raises(SettingsError, match="no effects to be left out"):
        valleys_beside(m, claim.with_frame(m))
