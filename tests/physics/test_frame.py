"""Film and frame in series, against bisection, where a tangent leads astray, and where nothing closes."""

import numpy as np
import pytest
from scipy.optimize import brentq

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.physics.effects.machine_compliance import MachineCompliance
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.frame import in_series
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import Status
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.uniaxial import Uniaxial

MEASURED = np.linspace(0.0, 1.0, 41)
NO_PLAY = (-20.0, 1.0)
"""ln of the play, and the force that takes it up."""
EXPONENTS = np.array([[0.3], [0.5], [1.0], [1.4]])


def film(rows: np.ndarray, delta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Slack up to a quarter of the way, steep beyond, and torn past 0.9."""
    over = np.maximum(delta - 0.25, 0.0)
    torn = delta > 0.9
    return np.where(torn, np.nan, 20 * over + 60 * over**3), np.where(torn, np.nan, (20 + 180 * over**2) * (over > 0))


def frame(rows: np.ndarray, force: np.ndarray, most: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    secant = 0.05 * np.maximum(np.abs(force), 1e-9) ** (EXPONENTS[rows] - 1)
    return secant * force, EXPONENTS[rows] * secant


def test_it_is_the_root_that_bisection_finds() -> None:
    delta, force, found = in_series(film, frame, np.tile(MEASURED, (len(EXPONENTS), 1)))
    assert np.all(found)

    def left(d: float, at: float, power: float) -> float:
        over = max(d - 0.25, 0.0)
        return d + 0.05 * (20 * over + 60 * over**3) ** power - at

    for i, power in enumerate(EXPONENTS[:, 0]):
        expected = [brentq(left, 0.0, 1.0, args=(at, power), xtol=1e-14) for at in MEASURED]
        assert delta[i] == pytest.approx(expected, abs=1e-10)
        assert force[i] == pytest.approx(film(np.array([i]), delta[i])[0])


@pytest.mark.parametrize("power", [0.5, 0.8, 1.3])
def test_a_frame_that_seats_is_the_root_of_one_reading_after_the_other(power: float) -> None:
    """Two cycles, the second one higher: by bisection at each reading, with the largest force of those before."""
    measured = np.interp(np.linspace(0, 4, 81), range(5), [0.0, 0.6, 0.1, 0.85, 0.3])
    x = np.array([[0.05, power, np.log(0.4 / 0.6), *NO_PLAY]])

    def seats(_: np.ndarray, force: np.ndarray, most: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return MachineCompliance().yielding(x, force, most)

    delta, force, found = in_series(film, seats, measured[None])
    assert found.all()
    most, one = 0.0, np.zeros(1, int)

    def left(d: float, at: float) -> float:
        pull = film(one, np.array([d]))[0]
        return d + 0.6 * 0.05 * pull[0] ** power + 0.4 * 0.05 * max(pull[0], most) ** power - at

    for at, d, f in zip(measured, delta[0], force[0], strict=True):
        # Where what has stayed is more than the disc was lifted, the film is slack.
        expected = brentq(left, -1.0, 0.9, args=(at,), xtol=1e-14)
        assert d == pytest.approx(expected, abs=1e-9)
        assert f == pytest.approx(film(one, np.array([d]))[0][0])
        most = max(most, f)
    assert np.max(force) > 3.0
    assert np.any(force[0, 50:] < force[0, 10] - 0.1)


def test_a_lost_station_leaves_the_curve_after_it() -> None:
    """What the film cannot follow has no force, and nothing is remembered of it."""
    x = np.array([[0.02, 0.8, -0.8, *NO_PLAY]])
    way = np.append(np.linspace(0, 0.8, 9), np.linspace(0.7, 0.3, 5))

    def seats(_: np.ndarray, force: np.ndarray, most: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return MachineCompliance().yielding(x, force, most)

    plain = in_series(film, seats, way[None])
    beyond = in_series(film, seats, np.insert(way, 9, 3.0)[None])
    assert plain[2].all()
    assert beyond[2].all()
    assert np.isnan(beyond[1][0, 9])
    assert np.delete(beyond[1], 9, axis=1) == pytest.approx(plain[1], rel=1e-8)  # each to 1e-11 of its largest way


@pytest.mark.parametrize("seed", range(3))
def test_hardly_a_film_near_locking_is_lost_for_a_frame_that_seats(seed: int) -> None:
    """Two cycles, the second one higher: of what is found on a frame where nothing stays 99 % is found where something
    does.
    """
    way = 0.06 * np.interp(np.linspace(0, 4, 60), range(5), [0.02, 0.6, 0.1, 1.0, 0.02])
    m = Measurement(way, np.ones(way.size), Uniaxial(), Specimen("tape", 1e-3), time=np.arange(1.0, 61.0))
    h = hypothesis("gent", ["machine_compliance"]).on(m)
    f = Forward(h, m, m.deflection)
    limits, rng = np.geomspace(0.3, 3.0, 300), np.random.default_rng(seed)
    film = np.stack([h.material.to_coordinates(np.array([20.0, limit])) for limit in limits])
    frames = np.stack(
        [
            10 ** rng.uniform(-4, -2, 300),
            rng.uniform(0.5, 1.2, 300),
            rng.normal(-1, 2, 300),
            rng.normal(0, 2, 300),
            0.05 * np.exp(rng.standard_normal(300)),
        ],
        axis=1,
    )
    seats = np.concatenate([film, frames], axis=1)
    plain = seats.copy()
    plain[:, h.names.index("machine_compliance.log_odds_seated")] = -20.0
    kept, lost = (np.array(f(x).ok) for x in (plain, seats))
    assert np.count_nonzero(kept) >= 297
    assert np.count_nonzero(kept != lost) <= 3


@pytest.mark.parametrize("effects", [["clamp_slip"], ["permanent_set"]])
def test_a_film_whose_slack_grows_with_what_it_has_seen_is_found_on_a_frame_that_seats(effects: list[str]) -> None:
    """Where the film is slack hangs on the largest deflection before, which moves as long as the search does."""
    way = 0.03 * np.interp(np.linspace(0, 4, 50), range(5), [0.0, 0.6, 0.05, 1.0, 0.0])
    m = Measurement(way, np.ones(way.size), Annulus(0.010, 0.035), Specimen("film", 1e-4), time=np.arange(1.0, 51.0))
    h = hypothesis("gent", ["machine_compliance", *effects]).on(m)
    f, rng = Forward(h, m, m.deflection), np.random.default_rng(11)
    x = np.stack([p.prior.quantile(rng.uniform(0.02, 0.98, 200)) for p in h.parameters], axis=1)
    x[:, h.names.index("machine_compliance.compliance")] = 10 ** rng.uniform(-4.3, -2, 200)
    assert np.count_nonzero(f(x).ok) >= 198


def test_a_film_that_falls_off_is_found_in_few_turns() -> None:
    """A force that is largest on the way, as of an energy that softens, on a frame that gives way by as much."""
    way, turns = np.linspace(0.01, 1.6, 200)[None], []

    def softening(rows: np.ndarray, delta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turns.append(rows.size)
        return delta * (2 - delta), 2 - 2 * delta

    def spring(rows: np.ndarray, force: np.ndarray, most: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return 0.3 * force, np.full(force.shape, 0.3)

    delta, force, found = in_series(softening, spring, way)
    assert found.all()
    assert delta + 0.3 * force == pytest.approx(way, abs=1e-10)
    assert force == pytest.approx(delta * (2 - delta), abs=1e-12)
    assert len(turns) < 10


def test_rows_do_not_mix_and_a_start_does_not_matter() -> None:
    together = in_series(film, frame, np.tile(MEASURED, (len(EXPONENTS), 1)))[1]
    for i in range(len(EXPONENTS)):

        def one(rows: np.ndarray, force: np.ndarray, most: np.ndarray, i: int = i) -> tuple[np.ndarray, np.ndarray]:
            return frame(rows + i, force, most)

        alone = in_series(film, one, MEASURED[None])[1]
        assert np.array_equal(alone[0], together[i])
        again = in_series(film, one, MEASURED[None], 1.3 * alone + 0.1)[1]
        assert again == pytest.approx(alone, rel=1e-8, abs=1e-9)


def test_what_does_not_close_has_no_force() -> None:
    """A film that pulls only where the frame would then slacken it."""

    def clicks(rows: np.ndarray, delta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.where((delta > 0.5) & (rows[:, None] == 0), 1.0, 0.0), np.zeros(delta.shape)

    def rod(rows: np.ndarray, force: np.ndarray, most: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return force, np.ones(force.shape)

    _, force, found = in_series(clicks, rod, np.ones((2, 1)))
    assert found.tolist() == [False, True]
    assert np.isnan(force[0, 0])
    assert force[1, 0] == 0.0


@pytest.mark.parametrize("play", [NO_PLAY, (1.0, 1e-3)])
def test_a_relaxed_film_on_a_frame_that_is_soft_at_no_force_closes(play: tuple[float, float]) -> None:
    """The return of a relaxing strip, whose force falls through zero; the seat yields like F^0.3, and has play."""
    strip = Uniaxial(0.1, 0.01)
    time = np.linspace(0.5, 40.0, 80)
    way = np.interp(time, [0.0, 20.0, 40.0], [0.0, 0.2, 0.02])
    m = Measurement(way, np.ones(way.size), strip, Specimen("tape", 1e-3), time=time)
    h = hypothesis("gent", ["viscoelastic", "machine_compliance"])
    f = Forward(h.on(m), m, m.deflection)
    theta = {"viscoelastic": [0.5, 20.0, 0.0, 0.5, -1.5, 0.0], "machine_compliance": [2e-3, 0.3, -0.8, *play]}
    x = np.concatenate([theta[e.name] for e in f.composition.effects])[None]
    law, _ = f.law(np.array([[20.0, 60.0]]), x)
    delta, force, status = f.composition.closed(law, x)
    assert status[0] != Status.ITERATION_LIMIT
    assert np.min(force) < 0 < np.max(force)
    p, before = np.array([theta["machine_compliance"]]), np.maximum.accumulate(np.append(0.0, force))[None, :-1]
    seat = next(e for e in f.composition.effects if isinstance(e, MachineCompliance))
    yielded, _ = seat.yielding(p, force, before)
    assert np.max(np.abs(delta + yielded - m.deflection)) < 1e-9 * m.full_range


def test_what_the_load_cell_adds_has_the_slopes_of_differences() -> None:
    """Its rows are not solved again; all others are."""
    strip = Uniaxial(0.1, 0.01)
    time = np.linspace(0.5, 40.0, 40)
    way = np.interp(time, [0.0, 20.0, 40.0], [0.0, 0.2, 0.02])
    m = Measurement(way, np.ones(way.size), strip, Specimen("tape", 1e-3), time=time)
    h = hypothesis("gent", ["machine_compliance", "force_drift", "permanent_set"]).on(m)
    f = Forward(h, m, m.deflection)
    x = np.concatenate([h.material.to_coordinates(np.array([20.0, 60.0])), *(e.typical for e in h.effects)])[None]
    x[0, h.names.index("permanent_set.log_delay")] = -1.0  # else it changes hardly more than the loop is closed to
    slopes = f(x, sensitivities=True).sensitivity
    assert slopes is not None
    for i in range(h.curve_size):
        step = np.zeros(x.shape)
        step[0, i] = 1e-4 * max(abs(x[0, i]), 1e-9)
        expected = (f(x + step).force - f(x - step).force)[0] / (2 * step[0, i])
        assert slopes[0, :, i] == pytest.approx(expected, rel=1e-2, abs=1e-4 * np.max(np.abs(expected)))
