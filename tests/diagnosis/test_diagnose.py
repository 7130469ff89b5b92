"""A small fixed part of `make study-loop`: clear cases at strength 1, from a generator that shares no code."""

import importlib
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.shipped import shipped
from bayesmembrane.diagnosis.diagnose import diagnose
from bayesmembrane.diagnosis.explanation.case import Question
from bayesmembrane.diagnosis.explanation.total import Probabilities
from bayesmembrane.diagnosis.explanation.verdict import Verdict
from bayesmembrane.diagnosis.result import VERDICTS, Diagnosis
from bayesmembrane.diagnosis.thresholds import VERDICT
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.registry import components, materials
from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis
from bayesmembrane.physics.materials.ogden import Ogden
from bayesmembrane.physics.rigs.equibiaxial import Equibiaxial
from bayesmembrane.words.diagnosis import document, sentence
from tests.diagnosis.curves import measured, pulled_and_held
from tests.generator.datasets import Dataset, generate

module = importlib.import_module("bayesmembrane.diagnosis.diagnose")  # the package has a function of that name

ALL, SOME = 1, 3
"""Every reading of the 700 that the generator makes, or every third: that is enough for a clear answer, and quicker."""


def some(measurement: Measurement, every: int = SOME) -> Measurement:
    """One reading in so many; the film remembers the whole way."""
    return measurement.select(np.arange(len(measurement)) % every == 0)


def answered(
    folder: Path, kind: str, material: str, protocol: str, noise: str, seed: int, every: int = SOME
) -> tuple[Dataset, Diagnosis]:
    data = generate(kind, material, protocol, noise, 1.0, seed)
    return data, diagnose(some(read_measurement(*data.write(folder)), every), Hypothesis(materials()[material]))


@pytest.mark.parametrize(
    ("material", "protocol", "noise", "seed"),
    [
        ("gent", "staircase", "white", 501),
        ("yeoh", "two_speeds", "ar1:0.5", 502),
        pytest.param("ogden", "single", "white", 503, marks=pytest.mark.study),
    ],
)
def test_nothing_is_missing_where_nothing_is(tmp_path, material, protocol, noise, seed) -> None:
    data, found = answered(tmp_path, "null", material, protocol, noise, seed, ALL)
    assert found.verdict == "adequate"
    assert found.effects == ()
    assert found.hypothesis.effects == ()
    assert found.noise.sd == pytest.approx(data.truth["noise"]["sd"], rel=0.2)
    assert found.noise.rho == pytest.approx(data.truth["noise"]["rho"], abs=0.2)
    assert "Nothing is seen to be missing" in sentence(found)
    assert all(size > 0 for size in found.power.values())


@pytest.mark.parametrize(
    ("kind", "material", "protocol", "seed", "every"),
    [
        # Relaxation is named below, too, on a strip, and friction in the reports' tests of loops.
        pytest.param("viscoelastic", "neo_hookean", "two_speeds", 512, ALL, marks=pytest.mark.study),
        ("force_drift", "neo_hookean", "staircase", 513, SOME),
        pytest.param("friction", "mooney_rivlin", "staircase_twice", 514, ALL, marks=pytest.mark.study),
    ],
)
def test_a_clear_effect_is_named_and_explains_the_residual(tmp_path, kind, material, protocol, seed, every) -> None:
    data, found = answered(tmp_path, kind, material, protocol, "white", seed, every)
    assert data.identifiable
    assert found.verdict == "named"
    assert found.effects == (kind,)
    assert components("effects")[kind]().title in sentence(found)
    assert [e.name for e in found.hypothesis.effects] == [kind]
    sd = data.truth["noise"]["sd"]
    assert found.after.rmse_N < 1.1 * sd < found.before.rmse_N
    assert found.validation.after.rmse_N < min(1.3 * sd, found.validation.before.rmse_N)
    assert found.ranking[0].candidate.names == (kind,)
    answer = json.loads(json.dumps(document(found)))
    assert (answer["verdict"], list(answer["effects"])) == ("named", [kind])
    assert answer["ranking"][0]["log_bayes_factor"] >= answer["ranking"][-1]["log_bayes_factor"]


@pytest.mark.study
def test_an_effect_with_a_look_alike_stays_inside_the_answer(tmp_path) -> None:
    # Slip and a permanent set both make the curve start later; 25 degrees apart here.
    data, found = answered(tmp_path, "clamp_slip", "gent", "staircase_twice", "white", 513)
    assert min(data.angles["clamp_slip"], key=data.angles["clamp_slip"].get) == "permanent_set"
    assert found.verdict in ("named", "ambiguous")
    assert "clamp_slip" in found.effects
    assert set(found.effects) <= {"clamp_slip", "permanent_set"}
    assert bool(found.experiments) == (found.verdict == "ambiguous")
    assert found.after.rmse_N < 1.1 * data.truth["noise"]["sd"]


@pytest.mark.study
def test_a_frame_that_stiffens_with_the_load_gets_no_other_name(tmp_path) -> None:
    """The library's frame is linear, and a shift of the zero looks alike: an energy that is a little off, too."""
    data, found = answered(tmp_path, "machine_compliance", "ogden", "two_speeds", "ar1:0.3+quantised+uneven", 120074)
    assert data.truth["effects"]["machine_compliance"]["form"] == "hardening"
    assert found.verdict != "named"
    # What is as much of an energy's shape as a stiffening frame is: none of what takes history or time.
    assert set(found.effects) <= {"zero_offset", "machine_compliance", "prestretch", "force_offset", "off_centre_disc"}


def test_what_is_not_in_the_library_gets_no_name(tmp_path) -> None:
    _, found = answered(tmp_path, "ripple", "gent", "staircase", "white", 521)
    assert found.verdict == "unknown"
    assert found.effects == ()
    assert "A wave of " in sentence(found)


def test_a_wrongly_declared_family_is_not_blamed_on_the_instrument(tmp_path) -> None:
    _, found = answered(tmp_path, "typical:gent", "neo_hookean", "single", "white", 531)
    assert found.verdict in ("material", "unknown")
    assert found.effects == ()
    assert found.hypothesis.effects == ()


def test_a_test_that_shows_nothing_says_so() -> None:
    """A stated noise as large as the forces: whatever is there, a model describes the curve."""
    m = read_measurement(shipped("elastosil_50um_op1.csv"), shipped("elastosil_50um_op1.toml"))
    blind = replace(m, covariance=None, force_sd=np.full(len(m), 10 * float(np.max(m.force))))
    found = diagnose(blind, hypothesis("gent"))
    assert found.verdict == "adequate"
    assert "It could not have shown any effect of a size that occurs" in sentence(found)
    assert "would have shown" not in sentence(found).replace("could not have shown", "")


def test_too_few_points_are_refused() -> None:
    few = measured(np.linspace(0.01, 0.1, 8), np.linspace(0.005, 0.04, 8))
    with pytest.raises(SettingsError, match="points"):
        diagnose(few, Hypothesis(Ogden))


@pytest.mark.study
def test_the_moment_of_a_sudden_change_is_told(tmp_path) -> None:
    data, found = answered(tmp_path, "temperature_step", "gent", "staircase_twice", "white", 50091)
    assert found.verdict == "unknown"
    assert found.probabilities.foreign["sudden_change"] > VERDICT.foreign_told
    assert "A sudden" in sentence(found)
    moment = data.truth["effects"]["temperature_step"]["when"] * data.time_s[-1]
    assert float(sentence(found).split(" % at ")[-1].split(" s")[0]) == pytest.approx(moment, abs=6)


@pytest.mark.study
def test_a_sudden_change_where_films_tear_is_a_tear_or_worse_and_nothing_is_sure(tmp_path) -> None:
    """It falls on the way to a new maximum: a tear there leaves the same trace."""
    _, found = answered(tmp_path, "temperature_step", "mooney_rivlin", "two_speeds", "ar1:0.5", 50086)
    assert found.verdict in ("ambiguous", "unknown")
    assert all(j.candidate.names == () or "tearing" in j.candidate.names for j in found.members)
    told = found.probabilities.foreign
    assert max(set(told) - {"none"}, key=lambda kind: told[kind]) == "sudden_change"


@pytest.mark.study
def test_what_the_form_of_a_named_effect_leaves_is_no_further_effect(tmp_path) -> None:
    """A stretched exponential of a signal-to-noise ratio of 60, which the library's spectrum has not."""
    data = generate("viscoelastic", "neo_hookean", "staircase", "white", 3.0, 50701)
    m = some(read_measurement(*data.write(tmp_path)))
    first = diagnose(m, Hypothesis(materials()["neo_hookean"]))
    assert "viscoelastic" in first.effects
    relaxing = next(j.candidate.hypothesis for j in first.members if j.candidate.names == ("viscoelastic",))
    second = diagnose(m, relaxing)
    assert second.verdict in ("adequate", "ambiguous")
    assert second.probabilities.effects["none"] > 0.3


def test_a_relaxation_test_shows_relaxation() -> None:
    time = np.concatenate([np.linspace(0.1, 5, 100), np.linspace(5.3, 100, 300)])
    m = pulled_and_held(time, 5.0, lambda lag: 1 - 0.35 * -np.expm1(-((lag / 12) ** 0.6)), 3e-3, 50811)
    found = diagnose(m, Hypothesis(materials()["neo_hookean"]))
    assert found.verdict in ("named", "ambiguous")  # a further effect that is not seen may be there
    assert all("viscoelastic" in j.candidate.names for j in found.members)
    assert found.probabilities.of_effect("viscoelastic") > 0.88  # some is told of other sets whatever is seen
    assert found.firm == ("viscoelastic",)
    assert next(iter(found.probabilities.effects)) == "viscoelastic"
    assert found.best.parameters["viscoelastic.strength"] == pytest.approx(0.35, rel=0.25)


def test_a_power_law_of_time_over_four_decades_is_relaxation() -> None:
    """As raw tapes and filled rubbers relax: no single time, and no box of times, comes near it."""
    time = np.concatenate([np.linspace(0.1, 10, 60), 10 + np.geomspace(0.2, 1800, 80)])
    m = pulled_and_held(time, 10.0, lambda lag: (1 + lag / 0.05) ** -0.12, 1e-3, 50812)
    found = diagnose(m, Hypothesis(materials()["mooney_rivlin"]))
    assert found.verdict in ("named", "ambiguous")
    assert all("viscoelastic" in j.candidate.names for j in found.members if j.probability > 0.01)
    assert next(iter(found.probabilities.effects)) == "viscoelastic"
    assert found.after.reduced_chi2 < 2


def test_the_tape_that_ships_relaxes() -> None:
    """By laws that were looked for far off it was `unknown`: hysteresis whose law is 37 % off led beside relaxation."""
    m = read_measurement(shipped("vhb4910_0d03.csv"), shipped("vhb4910_0d03.toml"))
    found = diagnose(m, Question(hypothesis("yeoh"), False))
    assert found.verdict in ("named", "ambiguous")
    assert sum(q for name, q in found.probabilities.effects.items() if "viscoelastic" in name) > 0.6
    assert "viscoelastic" in max(found.probabilities.effects, key=found.probabilities.effects.__getitem__).split("+")


def test_a_stated_deviation_that_the_readings_contradict_raises_no_alarm(tmp_path) -> None:
    data = generate("null", "yeoh", "two_speeds", "ar1:0.5", 1.0, 504)
    curve, specimen = data.write(tmp_path)
    specimen.write_text(specimen.read_text() + f"\n[measurement]\nforce_sd_N = {data.truth['noise']['sd'] / 1.5}\n")
    found = diagnose(read_measurement(curve, specimen), Hypothesis(materials()["yeoh"]))
    assert found.verdict == "adequate"
    assert not found.noise.stated
    assert found.noise.excess == pytest.approx(1.5, rel=0.2)
    assert "Of the noise" in sentence(found)


def test_points_as_few_as_a_model_with_an_effect_has_coordinates_are_diagnosed() -> None:
    """An effect then leaves nothing from which a noise could be told."""
    stretch = np.array([1.43586233, 1.83998239, 2.27175154, 2.69922374, 3.18189218, 3.56241002])
    stress = 1e6 * np.array([0.0719473831, 0.101390533, 0.127559295, 0.152277887, 0.179799764, 0.201397329])
    rig, specimen = Equibiaxial(), Specimen("few", 5e-5)
    force = stress * rig.width * specimen.thickness
    curve = Measurement(rig.length * (stretch - 1), force, rig, specimen, time=28.1 * np.arange(6.0))
    assert diagnose(curve, Hypothesis(materials()["gent"], convexity="elliptic")).verdict in VERDICTS


@pytest.mark.parametrize(
    ("sets", "clear", "firm"),
    [
        ({"friction+mullins": 0.97, "friction": 0.03}, ("friction", "mullins"), ("friction", "mullins")),
        ({"friction+mullins": 0.97, "friction": 0.03}, ("friction",), ("friction",)),
        ({"friction+mullins": 0.97, "friction": 0.03}, (), ()),
        ({"friction": 0.5, "friction+mullins": 0.46, "mullins": 0.04}, ("friction", "mullins"), ("friction",)),
        ({"friction": 0.5, "mullins": 0.5}, ("friction", "mullins"), ()),
        # Nearly nine in ten are enough, for a part is told of other sets whatever is seen; less are not.
        ({"friction": 0.6, "friction+mullins": 0.29, "rate": 0.11}, ("friction",), ("friction",)),
        ({"friction": 0.6, "friction+mullins": 0.27, "rate": 0.13}, ("friction",), ()),
    ],
)
@pytest.mark.parametrize("strange", [True, False])
def test_what_is_in_all_that_is_probable_and_explains_more_than_is_left_is_firm_and_a_strange_rest_takes_the_name(
    monkeypatch: pytest.MonkeyPatch,
    sets: dict[str, float],
    clear: tuple[str, ...],
    firm: tuple[str, ...],
    strange: bool,
) -> None:
    left: Any = SimpleNamespace(strange=strange, firm=lambda names: [n for n in names if n in clear])
    monkeypatch.setattr(module, "at_a_turn", lambda *models: None)
    first: Any = SimpleNamespace(candidate=SimpleNamespace(names=("friction", "mullins")))
    found = Verdict("named", (first,), (), Probabilities(sets, {}, {"none": 1.0}))
    search: Any = SimpleNamespace(measurement=None)
    assert module._firm(search, found, left) == firm
    assert module._finished(search, found, left).verdict == ("unknown" if strange else "named")
    assert module._firm(search, replace(found, verdict="unknown"), left) == ()
