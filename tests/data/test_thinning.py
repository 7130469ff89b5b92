"""A long measurement in fewer readings: what is kept, and that the film still remembers the rest."""

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.thinning import MOST, thinned
from bayesmembrane.ground.registry import material
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.biaxial import Biaxial
from bayesmembrane.physics.rigs.uniaxial import Uniaxial


def cyclic(n: int = 4000, **more: object) -> Measurement:
    """Three cycles to growing tops, with a hold at the second."""
    tops = [0.0, 0.02, 0.0, 0.035, 0.035, 0.0, 0.05, 0.01]
    at = np.array([0, 1, 2, 3.2, 4.2, 5.2, 6.7, 8.0])
    time = np.linspace(0, 8, n)
    d = np.interp(time, at, tops)
    force = d * (1 + 0.1 * np.sin(50 * d))
    return Measurement(d, force, Uniaxial(), Specimen("strip", 1e-3), time=time, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("most", [100, 500, MOST])
def test_ends_turning_points_and_holds_are_kept(most: int) -> None:
    whole = cyclic()
    part = thinned(whole, most)
    assert most / 2 < len(part) <= most
    assert np.all(np.isin(part.time, whole.time))
    assert np.all(np.diff(part.time) > 0)
    assert (part.time[0], part.time[-1]) == (whole.time[0], whole.time[-1])
    turns = np.flatnonzero(np.diff(whole.leg.astype(int)))
    assert turns.size == 5
    assert np.all(np.isin(whole.time[turns], part.time))
    assert len(part.holds) == len(whole.holds) == 1
    for end in (0, -1):
        assert whole.time[whole.holds[0][end]] in part.time
    assert np.max(np.diff(part.time)) < 3 * 8 / most
    assert part.full_range == whole.full_range
    assert np.array_equal(part.leg, whole.leg[np.isin(whole.time, part.time)])
    assert np.array_equal(part.cycle, whole.cycle[np.isin(whole.time, part.time)])


def test_readings_keep_their_noise() -> None:
    sd = np.linspace(0.1, 0.2, 4000)
    part = thinned(cyclic(force_sd=sd), 300)
    assert part.force_sd == pytest.approx(sd[part.on_path])
    whole = cyclic(200)
    covariance = 0.5 ** np.abs(np.subtract.outer(np.arange(200.0), np.arange(200.0)))
    part = thinned(cyclic(200, covariance=covariance), 60)
    at = np.flatnonzero(np.isin(whole.time, part.time))
    assert part.covariance == pytest.approx(covariance[np.ix_(at, at)])


def test_the_film_remembers_what_was_left_out() -> None:
    whole = cyclic()
    part = thinned(whole, 200)
    claim = hypothesis("neo_hookean", ["mullins", "viscoelastic"])
    x = np.concatenate([material("neo_hookean").to_coordinates([150.0]), *(e.typical for e in claim.effects)])
    forces = [Forward(claim, m, m.deflection)(x).force[0] for m in (whole, part)]
    assert forces[1] == pytest.approx(forces[0][part.on_path], rel=1e-9, abs=1e-12)


def test_a_short_measurement_stays_itself_and_many_turns_stay_within_the_limit() -> None:
    short = cyclic(MOST)
    assert thinned(short) is short
    time = np.arange(9000.0)
    d = 0.02 + 0.02 * np.sin(time)
    shaken = Measurement(d, d, Uniaxial(), Specimen("strip", 1e-3), time=time)
    assert MOST / 2 < len(thinned(shaken)) <= MOST


def test_states_of_a_biaxial_test_keep_their_stretch_across() -> None:
    d = np.linspace(0.01, 0.05, 3000)
    across = np.linspace(1.0, 1.4, 3000)
    whole = Measurement(d, d, Biaxial(), Specimen("film", 1e-3), across=across)
    part = thinned(whole)
    assert len(part) <= MOST
    assert part.across == pytest.approx(np.interp(part.deflection, d, across))
