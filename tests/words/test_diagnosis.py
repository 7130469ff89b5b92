"""Sentences speak in the units of the rig: forces and lengths of a lifted disc, stresses and stretches of a strip."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.explanation.telling import NOTHING
from bayesmembrane.diagnosis.explanation.total import Probabilities
from bayesmembrane.diagnosis.left.shape import residual_shape
from bayesmembrane.diagnosis.reference.noise import OwnNoise
from bayesmembrane.diagnosis.result import Diagnosis, Thinned, thinning
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.base import Rig
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from bayesmembrane.words import diagnosis as words
from bayesmembrane.words.diagnosis import elsewhere, percent, probabilities_told, thinning_sentence
from bayesmembrane.words.shape import shape_in_words
from bayesmembrane.words.sizes import flagged_size, units_of
from bayesmembrane.words.units import SCALES, read_as, size_in_words

THICKNESS = 1e-3
STRETCH = np.concatenate([np.linspace(1.01, 1.5, 30), np.linspace(1.49, 1.01, 30)])


def describe(m: Measurement, residual: Array) -> str:
    return shape_in_words(residual_shape(m, residual), None, m.rig, m.rig.shown(m.specimen.thickness))


def strip(width: float, length: float = 0.05) -> Measurement:
    rig = Uniaxial(length, width)
    stress = 4e4 * (STRETCH - 1)
    return Measurement(length * (STRETCH - 1), stress * width * THICKNESS, rig, Specimen("strip", THICKNESS))


@pytest.mark.parametrize("width", [0.005, 0.02])
@pytest.mark.parametrize("length", [0.05, 0.1])
def test_a_residual_in_stress_reads_alike_whatever_the_strip_measures(width: float, length: float) -> None:
    m = strip(width, length)
    stress = np.where(m.leg > 0, 700.0, -300.0)
    stress[29] = 2000.0
    told = describe(m, stress * width * THICKNESS)
    rms = np.sqrt(np.mean(stress**2)) / 1e6
    assert told.startswith(
        f"The residual has a root mean square of {rms:.3g} MPa and reaches 0.002 MPa at a stretch of 1.5."
    )
    gap = (np.mean(stress[m.leg > 0]) - np.mean(stress[m.leg < 0])) / 1e6
    assert f"Loading legs lie {gap:.3g} MPa above unloading legs." in told
    assert "mN" not in told
    assert "mm" not in told


def test_a_lifted_disc_is_told_in_forces_and_lengths() -> None:
    d = np.linspace(1e-3, 35e-3, 40)
    m = Measurement(d, 50 * d, Annulus(0.010, 0.035), Specimen("film", 5e-5))
    told = describe(m, np.where(d == d[-1], 0.02, 0.001))
    assert "reaches 20 mN at 35 mm." in told


def test_units_of_a_strip_undo_what_its_size_does() -> None:
    """A stress s is the force s w t, a stretch the deflection L (l - 1); their quotients follow."""
    rig = Uniaxial(0.08, 0.02)
    shown = rig.shown(THICKNESS)
    area = 0.02 * THICKNESS
    assert shown["N"] == (pytest.approx(1e-6 / area), "MPa")
    assert size_in_words(0.25 * 0.08, "m", shown) == "0.25 in stretch"
    assert size_in_words(3e3 * area, "N", shown) == "0.003 MPa"
    assert size_in_words(3e3 * area, "N/s", shown) == "0.003 MPa/s"
    assert size_in_words(0.25 * 0.08 / (3e3 * area), "m/N", shown) == "83.3 1/MPa"
    assert size_in_words(0.5, "-", shown) == "0.5"
    assert size_in_words(1.2e-83, "-", shown) == "0"
    assert size_in_words(1.02094, "-", shown, null=1.0) == "1.0209"
    assert size_in_words(1.02094, "-", shown) == "1.02"
    told = read_as(shown)
    assert told["N"] == {"factor": pytest.approx(1e-6 / area), "unit": "MPa"}
    assert set(told) == set(shown)


def test_every_effect_says_the_unit_of_each_of_its_parameters() -> None:
    for name, effect in components("effects").items():
        declared = {f"{name}.{p.name}": p.unit for p in effect.coordinates}
        assert units_of(declared) == declared
        assert units_of([f"{name}@strip.{effect.coordinates[0].name}"]) == {
            f"{name}@strip.{effect.coordinates[0].name}": effect.coordinates[0].unit
        }


def test_every_rig_shows_the_same_quantities() -> None:
    rigs: dict[str, type[Rig]] = components("rigs")
    for kind in rigs.values():
        rig = kind.example()
        assert set(rig.shown(THICKNESS)) == set(SCALES)
    assert Annulus(0.010, 0.035).shown(THICKNESS) == SCALES


def test_it_is_said_how_many_readings_were_taken_and_only_where_some_were_left_out() -> None:
    whole = strip(0.02)
    part = whole.select(np.arange(0, 60, 3))
    assert thinning(whole, whole) is None
    assert (found := thinning(whole, part)) == Thinned(20, 60)
    assert thinning_sentence(found).startswith("20 of the 60 readings were diagnosed, one in 3: ")


def test_what_is_not_enough_for_a_name_does_not_look_as_if_it_were() -> None:
    assert [percent(p) for p in (0.9449, 0.94994, 0.95, 0.954)] == ["94.5 %", "94.9 %", "95 %", "95.4 %"]


@pytest.mark.parametrize("timed", [True, False])
def test_a_rate_of_a_test_that_nobody_timed_says_what_is_assumed(timed: bool) -> None:
    d = np.linspace(0.001, 0.03, 30)
    time = np.arange(30.0) if timed else None
    m = Measurement(d, 8 * d, Annulus(0.010, 0.035), Specimen("film", 50e-6), time=time)
    h = hypothesis("neo_hookean", ["force_drift"]).on(m)
    (effect,), nothing = h.effects, np.zeros(30)
    x = np.array([2.0, *effect.typical])
    x[1 + effect.sizes[0]] = 1e-4
    drifts = Candidate(h, x, nothing, nothing[:, None], 0.0, (), nothing[None], np.zeros(3), nothing)
    assert ("assumed 1 mm/s" in flagged_size(effect, drifts, m)) is not timed


def test_what_is_only_concluded_is_told_beside_what_was_found() -> None:
    kinds = {"none": 0.6, "ripple": 0.3, "unlisted": 0.06, "another_law": 0.04}
    told = probabilities_told(Probabilities({"friction": 1.0}, {"yeoh": 1.0}, kinds))[1:]
    assert told == [
        "something foreign 30 %",
        "a law that is not in the library 4 %",
        "a fault that is not in the library 6 %",
    ]


def test_what_is_in_nearly_all_sets_is_told_first() -> None:
    sets = {"viscoelastic": 0.5, "friction+viscoelastic": 0.3, "tearing+viscoelastic": 0.18, "tearing": 0.02}
    told = probabilities_told(Probabilities(sets, {"yeoh": 1.0}, {"none": 0.9, "ripple": 0.1}))
    relaxation = "viscoelastic relaxation"
    assert told[:4] == [
        f"{relaxation} 98 %",
        "alone 50 %",
        "with friction in the guide 30 %",
        "with tearing of the film 18 %",
    ]
    sets = {"friction+viscoelastic": 0.6, "tearing": 0.4}
    assert probabilities_told(Probabilities(sets, {"yeoh": 1.0}, {"none": 1.0})) == [
        f"friction in the guide and {relaxation} 60 %",
        "tearing of the film 40 %",
    ]
    sets = {"viscoelastic": 0.97, "friction+viscoelastic": 0.03}
    assert probabilities_told(Probabilities(sets, {"yeoh": 1.0}, {"none": 1.0}))[0] == f"{relaxation} 97 %"


def test_what_is_told_of_other_sets_is_said_from_a_twentieth_on() -> None:
    told = {"friction": 0.7, "mullins": 0.2, "tearing": 0.06, "rate": 0.04}
    p = Probabilities(told, {"gent": 1.0}, {NOTHING: 1.0})
    assert elsewhere(p, {"friction", "mullins"}) == "; or another set (10 %)"
    assert elsewhere(p, {"friction", "mullins", "tearing"}) == ""


@pytest.mark.parametrize(
    ("stated", "grows"), [(None, True), (np.full(3, 1e-3), True), (np.array([1e-3, 2e-3, 3e-3]), False)]
)
def test_noise_is_told_to_grow_where_readings_say_so_and_not_where_it_is_stated(
    stated: Array | None, grows: bool
) -> None:
    """Of readings that scatter more than a deviation that is stated for each, its proportions are kept."""
    rig, specimen = Annulus(0.01, 0.035), Specimen("film", 5e-5)
    film = Measurement(np.linspace(0.01, 0.03, 3), np.linspace(0.1, 1.0, 3), rig, specimen, force_sd=stated)
    noise = OwnNoise(4e-3, 0.0, 0.0, np.ones(2), None, 40.0, profile=np.array([0.5, 1.0, 1.3]), excess=2.0)
    found = SimpleNamespace(noise=noise, measurement=film, rig=rig, thickness=specimen.thickness)
    told = words._noise(cast(Diagnosis, found))
    assert ("it grows with the force, from 2 mN to 5.2 mN" in told) is grows
    assert "2.00 times" in told
