"""The form error: its processes as low-rank factors, and the traces of effects."""

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.form_error import (
    CHANGE,
    ENERGY,
    LAW,
    LOCAL,
    PROGRESS_LENGTHS,
    SPEED_ERROR,
    STATE_LENGTHS,
    error_at_another_speed,
    form_columns,
    form_factors,
    joint_factors,
    progress,
    states,
    traces,
    unseen_columns,
    unsteady,
)
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus

LAWS = [name for name, e in components("effects").items() if not e.exact and e.occurs_on(Annulus)]
EXACT = [name for name, e in components("effects").items() if e.exact and e.occurs_on(Annulus)]


def cyclic(points: int = 80) -> Measurement:
    d = np.interp(np.linspace(0.02, 4, points), [0, 1, 2, 3, 4], [0, 0.02, 0.0, 0.04, 0.001])
    time = np.arange(1.0, points + 1)
    return Measurement(d, 100 * d, Annulus(0.010, 0.035), Specimen("film", 50e-6), time=time)


def kernel(place: np.ndarray, lengths: tuple[float, ...]) -> np.ndarray:
    square = np.sum((place[:, None, :] - place[None, :, :]) ** 2, axis=2)
    return np.mean([np.exp(-0.5 * square / length**2) for length in lengths], axis=0)


def test_factors_times_their_transposes_are_the_processes() -> None:
    m = cyclic()
    found = form_factors(m)
    for root, place, lengths in (
        (found.state, states(m), STATE_LENGTHS),
        (found.progress, progress(m)[:, None], PROGRESS_LENGTHS),
    ):
        assert root.shape[1] < len(m) / 2
        assert np.sum(root**2, axis=1) == pytest.approx(1.0)
        np.testing.assert_allclose(root @ root.T, kernel(place, lengths), atol=2e-3)


def test_an_energy_errs_alike_on_every_leg_and_a_law_does_not() -> None:
    m = cyclic()
    up, down = 50, int(np.argmin(np.abs(m.deflection[60:] - m.deflection[50]))) + 60
    found = form_factors(m)
    assert m.leg[up] != m.leg[down]
    assert found.state[up] @ found.state[down] > 0.99
    assert found.progress[up] @ found.progress[down] < 0.95


def test_joint_factors_are_the_same_process_at_the_readings() -> None:
    m = cyclic()
    there = Motion(np.linspace(0.002, 0.05, 25), None, m.full_range)
    joint, alone = joint_factors(m, there), form_factors(m)
    n = len(m)
    for a, b in ((joint.state, alone.state), (joint.progress, alone.progress)):
        assert len(a) == n + 25
        np.testing.assert_allclose(a[:n] @ a[:n].T, b @ b.T, atol=4e-3)
    everywhere = np.concatenate([states(m)[:, 0], there.deflection / m.full_range])[:, None]
    np.testing.assert_allclose(joint.state @ joint.state.T, kernel(everywhere, STATE_LENGTHS), atol=2e-3)


def at(times: float | None, back: float | None = None) -> Motion:
    """A cycle ``times`` as fast, back at another speed."""
    d = np.interp(np.linspace(0, 2, 61), [0, 1, 2], [0, 0.04, 0])
    if times is None:
        return Motion(d, None, 0.04)
    gap = np.where(np.arange(61) <= 30, 1 / times, 1 / (times if back is None else back))
    return Motion(d, np.cumsum(gap), 0.04)


def test_a_law_is_off_at_another_speed_by_its_logarithm_whichever_is_the_faster() -> None:
    assert not np.any(error_at_another_speed(at(1), at(1)))
    assert error_at_another_speed(at(1), at(4)) == pytest.approx(SPEED_ERROR * np.log(4))
    assert error_at_another_speed(at(4), at(1)) == pytest.approx(SPEED_ERROR * np.log(4))
    assert not np.any(error_at_another_speed(at(1), at(None)))
    assert not np.any(error_at_another_speed(at(None), at(1)))


def test_a_speed_between_those_of_two_legs_was_seen_and_each_leg_has_its_own() -> None:
    assert error_at_another_speed(at(1, 10), at(3)) == pytest.approx(0, abs=1e-9)
    found = error_at_another_speed(at(1), at(1, 5))
    assert found[:29] == pytest.approx(0, abs=1e-9)
    assert found[33:] == pytest.approx(SPEED_ERROR * np.log(5))


def test_rest_is_no_speed() -> None:
    d = np.concatenate([np.linspace(0.001, 0.04, 30), np.full(40, 0.04), np.linspace(0.039, 0.001, 30)])
    held = Motion(d, np.arange(1.0, 101.0), 0.04)
    assert held.leg_speed == pytest.approx(0.039 / 29, rel=0.05)


def test_what_another_speed_may_show_is_of_trace_and_force_but_no_larger_than_the_force() -> None:
    m, h = cyclic(40), hypothesis("neo_hookean", ["force_offset", "friction"])
    rng = np.random.default_rng(2)
    force, trace = m.force, rng.standard_normal((2, 40))
    for larger in (0.1 * np.linalg.norm(force), 10.0 * np.linalg.norm(force)):
        t = larger / np.linalg.norm(trace[1]) * trace[1]
        (columns,) = unseen_columns(form_factors(m), force, h.effects, np.stack([trace[0], t]))  # an offset is exact
        part = np.linalg.norm(t) / np.linalg.norm(force)
        assert np.sum(columns**2, axis=1) == pytest.approx(np.minimum(t**2 + (part * force) ** 2, force**2))


@pytest.mark.parametrize("name", LAWS)
def test_the_trace_is_what_an_effect_changes(name: str) -> None:
    m, h = cyclic(24), hypothesis("neo_hookean", [name, "force_offset"])
    forward, plain = Forward(h, m, m.deflection), Forward(hypothesis("neo_hookean"), m, m.deflection)
    effect = h.effects[0]
    x = np.array([[np.log(15.0), *effect.typical, 0.0], [np.log(15.0), *effect.null, 0.0]])
    force = forward(x, reached=False).force
    found = traces(forward, x, force)
    alone = plain(x[:, :1], reached=False).force
    np.testing.assert_allclose(found[0, 0], force[0] - alone[0], atol=1e-6 * np.max(np.abs(force)))
    assert np.any(found[0, 0] != 0)
    assert not np.any(found[1, 0])
    assert not np.any(found[:, 1])


@pytest.mark.parametrize("name", EXACT)
def test_what_is_exact_has_no_law_to_be_inferred(name: str) -> None:
    names = [p.name for p in hypothesis("neo_hookean", [name], "form").parameters]
    assert names[-3:] == ["noise.ln_sd", "noise.ln_eta", "noise.ln_eta_local"]


def test_one_law_that_may_be_off_adds_one_coordinate_however_many_there_are() -> None:
    one = hypothesis("neo_hookean", LAWS[:1], "form")
    two = hypothesis("neo_hookean", [*LAWS[:2], *EXACT[:1]], "form")
    assert one.noise == two.noise
    assert one.parameters[-1].name == "noise.ln_eta_law"
    assert one.natural_names[-4:] == ("noise.sd", "noise.eta", "noise.eta_local", "noise.eta_law")


def test_unsteady_readings_are_those_at_the_start_at_turns_at_slack_ends_and_where_it_stops() -> None:
    up = np.linspace(0.0, 0.02, 11)
    deflection = np.concatenate([up, up[-2::-1], up[1:]])
    force = np.maximum(100.0 * deflection - 0.5 * (np.arange(31) > 10) * (np.arange(31) < 20), 0.0)
    m = Measurement(deflection, force, Annulus(0.010, 0.035), Specimen("film", 5e-5))
    found = set(unsteady(m).tolist())
    assert {0, 1, 2} <= found  # the start
    assert {10, 11, 12, 20, 21, 22} <= found  # either turn
    assert {18, 19} <= found  # slack on the way down
    assert {29, 30} <= found  # the drive comes to rest
    assert not {5, 15, 25} & found
    assert np.array_equal(form_factors(m).local, np.eye(31)[:, sorted(found)])


def test_a_test_that_ends_in_a_hold_is_steady_there() -> None:
    deflection = np.concatenate([np.linspace(0.0, 0.02, 11), np.full(20, 0.02)])
    m = Measurement(deflection, 100.0 * deflection, Annulus(0.010, 0.035), Specimen("film", 5e-5))
    assert not {29, 30} & set(unsteady(m).tolist())


@pytest.mark.parametrize("name", ["prestretch", "zero_offset"])
def test_what_may_change_during_a_test_has_a_trace_where_it_is_asked_for(name: str) -> None:
    """And an error that is expected to be much smaller than that of a law; nothing is inferred of it in a run."""
    m, h = cyclic(24), hypothesis("neo_hookean", [name])
    effect, forward = h.effects[0], Forward(h, m, m.deflection)
    x = np.array([[np.log(15.0), *effect.typical]])
    force = forward(x, reached=False).force
    assert not np.any(traces(forward, x, force))
    shown = traces(forward, x, force, changing=True)[0]
    alone = Forward(hypothesis("neo_hookean"), m, m.deflection)(x[:, :1], reached=False).force
    np.testing.assert_allclose(shown[0], force[0] - alone[0], atol=1e-6 * np.max(force))
    sizes = [p for p, _ in form_columns(form_factors(m), force[0], h.effects, shown)]
    assert sizes == [ENERGY, CHANGE, LOCAL]
    assert CHANGE.prior.quantile(0.5) < LAW.prior.quantile(0.05)
    assert not unseen_columns(form_factors(m), force[0], h.effects, shown)
