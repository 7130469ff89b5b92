"""The study of break points and speeds: its statistics keep their level, its films go with the thickness."""

import numpy as np
import pytest

from bayesmembrane.calibration.beside_paper import BreakPoint, SpeedTest
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.physics.mechanics.api import force_curve
from bayesmembrane.physics.rigs.annulus import Annulus
from tests.studies.paper_breaks import Scatter, between, beyond_scatter, films, scaled, specimens_needed, trend, within
from tests.studies.paper_breaks_page import page

AT = np.linspace(0.004, 0.080, 12)
GROUPS = (1, 1, 2, 2, 3, 3)


@pytest.fixture(scope="module")
def curve() -> Measurement:
    return Measurement(AT, force_curve("neo_hookean", (7.0,), AT)[0], Annulus(0.010, 0.035), Specimen("film", 50e-6))


def test_scatter_is_that_within_groups_whatever_lies_between() -> None:
    values = np.array([1.0, 3.0, 11.0, 13.0, 25.0, 27.0])
    found = within(values, GROUPS)
    assert found == Scatter(pytest.approx(np.sqrt(2.0)), 3)
    assert within(values - np.repeat([0, 10, 24], 2), GROUPS).sd == pytest.approx(found.sd)
    low, high = found.interval
    assert low < found.sd < high
    assert between(values, GROUPS) < 0.01
    assert between(values - np.repeat([0, 10, 24], 2), GROUPS) > 0.9


def test_single_specimens_that_differ_like_replicates_are_seldom_told_apart() -> None:
    """Level and coverage on data without an effect: 5 % of alarms, 95 % of intervals that hold the slope."""
    rng = np.random.default_rng(3)
    trials, alarms, held = 2000, 0, 0
    x = np.array([-1.0, 0.0, 1.0])
    for _ in range(trials):
        pairs, singles = rng.normal(size=6), rng.normal(size=3)
        scatter = within(pairs, GROUPS)
        alarms += beyond_scatter(singles, scatter) < 0.05
        slope, half = trend(x, 0.7 * x + singles, scatter)
        held += abs(slope - 0.7) <= half
    assert alarms / trials == pytest.approx(0.05, abs=0.015)
    assert held / trials == pytest.approx(0.95, abs=0.015)


def test_half_the_effect_takes_four_times_the_specimens() -> None:
    scatter = Scatter(0.2, 3)
    assert specimens_needed(scatter, 0.001) == pytest.approx(4 * specimens_needed(scatter, 0.002), rel=1e-4)
    assert specimens_needed(scatter, 2.0) == 1


def test_forces_go_with_the_thickness(curve: Measurement) -> None:
    thin, thick = (BreakPoint("a", h, float(AT[7]), 1.0) for h in (50e-6, 200e-6))
    far = BreakPoint("b", 50e-6, 0.120, 1.0)
    assert scaled(curve, [thin, thick, far]) == pytest.approx([curve.force[7], 4 * curve.force[7], np.nan], nan_ok=True)
    (film,) = films(curve, [thick, far, thin], ["neo_hookean"])
    expected = force_curve("neo_hookean", (7.0,), [float(AT[7]), 0.120])[0]
    assert film.force == pytest.approx([4 * expected[0], expected[1], expected[0]], rel=1e-5)
    assert film.rmse < 1e-6
    assert film.stretch[1] > film.stretch[0] == film.stretch[2] > 1


def broken(curve: Measurement, deflection: list[float]) -> list[BreakPoint]:
    """Pairs of proportional films that bear 2 % more or less than the curve."""
    out = []
    for i, (h, d) in enumerate(zip(np.repeat([50e-6, 100e-6, 200e-6], 2), deflection, strict=True)):
        point = BreakPoint(str(i + 1), float(h), d, 0.0)
        force = float(scaled(curve, [point])[0]) * (1.02 if i % 2 else 0.98)
        out.append(BreakPoint(point.specimen, point.thickness, d, force))
    return out


def test_the_page_tells_a_thickness_that_matters_from_one_that_does_not(curve: Measurement) -> None:
    rates = [SpeedTest(1e-4, 5.0), SpeedTest(1e-3, 5.1), SpeedTest(1e-2, 7.0)]

    def told(deflection: list[float]) -> str:
        breaks = broken(curve, deflection)
        return page(curve, breaks, rates, scaled(curve, breaks), films(curve, breaks, ["neo_hookean"]))

    alike = told([0.060, 0.0605, 0.0602, 0.0604, 0.0601, 0.0603])
    assert "Proportionality is not contradicted" in alike
    (line,) = (x for x in alike.splitlines() if x.startswith("- Deflection at break"))
    assert line.endswith("no effect of thickness is shown.")
    (line,) = (x for x in alike.splitlines() if x.startswith("- Force at break:"))
    assert line.endswith("thickness matters.")
    assert "The effect is shown." in alike
    apart = told([0.070, 0.0705, 0.060, 0.0604, 0.050, 0.0503])
    (line,) = (x for x in apart.splitlines() if x.startswith("- Deflection at break"))
    assert line.endswith("thickness matters.")
