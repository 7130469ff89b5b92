"""The third generator: it knows nobody, a case is what its seed makes of it, and a study asks what it is to."""

import ast
from collections import Counter
from functools import cache
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.data.reading import read_measurement
from bayesmembrane.ground.registry import components, materials, ordinary_materials
from tests.generator_three.datasets import Dataset, generate
from tests.generator_three.energies import COMMON, ENERGIES
from tests.generator_three.flaws import EFFECTS, FOREIGN
from tests.generator_three.recipes import CASES, GROUPS, recipes
from tests.seeds import NUMPY
from tests.studies import reliability
from tests.studies.reliability_plan import OF_THE_FILM, third_measured, third_plan

FOLDER = Path(__file__).parent
SEED = 20_260_723
# Of the files that were written with this seed at first: (readings, their sum N, the largest N) and own ratios.
AS_BEFORE = {
    1: ((467, 320.522754, 1.3308446), {"prestretch": 15.137422, "permanent_set": 4.463234}),
    4: ((561, 113.729540, 0.66608), {"backlash": 19.061660}),
    8: ((160, 71.975760, 1.65169), {"permanent_set": 9.555419}),
    26: ((314, 35.087909, 0.32110516), {"hysteresis": 13.045062, "zero_offset": 5.834577}),
}
WITH_ITS_SEED = pytest.mark.skipif(np.random.default_rng is not NUMPY, reason="other streams make other cases")


@cache
def made(number: int) -> Dataset:
    return generate(next(islice(recipes(SEED), number, None)))


# ---- independence ----------------------------------------------------------------------------------------------------


def test_it_shares_nothing_with_the_other_generators_and_the_package() -> None:
    files = [f for f in FOLDER.glob("*.py") if not f.name.startswith("test_")]
    assert len(files) > 10
    for file in files:
        nodes = list(ast.walk(ast.parse(file.read_text())))
        names = {a.name for n in nodes if isinstance(n, ast.Import) for a in n.names}
        names |= {n.module or "." for n in nodes if isinstance(n, ast.ImportFrom)}
        for name in names:
            assert name.startswith("tests.generator_three") or name.partition(".")[0] in {
                *("__future__", "collections", "dataclasses", "functools", "itertools", "pathlib", "typing"),
                *("numpy", "scipy"),
            }, name
        assert "importlib" not in file.read_text()


def test_names_are_those_of_the_package_where_it_has_them_and_no_others() -> None:
    for name in COMMON:
        assert materials()[name].field_names() == ENERGIES[name].names
    assert set(ENERGIES) & set(ordinary_materials()) == set(COMMON)
    assert set(EFFECTS) <= set(components("effects"))
    assert not set(FOREIGN) & set(components("effects"))


# ---- cases -----------------------------------------------------------------------------------------------------------


def test_shares_of_a_seed_are_exact_and_its_order_is_its_own() -> None:
    cases = list(recipes(SEED))
    assert len(cases) == CASES
    assert Counter(c.group for c in cases) == Counter(GROUPS)
    assert sum(c.common_energy for c in cases) == 72
    assert [
        sum(getattr(c.noise, k) for c in cases) for k in ("correlated", "grows", "strays", "rounded", "stated")
    ] == [*(30, 30, 18, 24, 60)]
    assert not any(c.noise.grows and c.noise.stated for c in cases)
    assert cases == list(recipes(SEED))
    assert [c.group for c in cases] != [c.group for c in recipes(SEED + 1)]


@WITH_ITS_SEED
@pytest.mark.parametrize("number", AS_BEFORE)
def test_a_case_is_what_it_was(number: int) -> None:
    (count, total, largest), own = AS_BEFORE[number]
    data = made(number)
    assert data.read.force.size == count
    assert np.sum(data.read.force) == pytest.approx(total, rel=1e-5)
    assert np.max(data.read.force) == pytest.approx(largest, rel=1e-5)
    assert data.truth["snr_own"] == pytest.approx(own, rel=1e-4)


@WITH_ITS_SEED
def test_a_recipe_is_one_measurement_that_is_read_as_it_was_written(tmp_path) -> None:
    data = made(2)
    recipe = data.case.recipe
    again = generate(recipe)
    assert again.csv == data.csv
    assert again.truth == data.truth
    assert made(0).csv != data.csv
    read = read_measurement(*data.write(tmp_path))
    np.testing.assert_allclose(read.force, data.read.force, rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(read.deflection, 1e-3 * data.path.at, atol=1e-12)
    assert np.all(np.diff(read.time) > 0)
    assert recipe.noise.stated
    assert read.force_sd == pytest.approx(data.case.sd, rel=1e-3)
    assert read_measurement(*made(0).write(tmp_path)).force_sd is None
    assert read.specimen.thickness == pytest.approx(1e-6 * data.case.stock.thickness)


@pytest.mark.parametrize("number", [1, 4, 5, 8, 20, 26, 34])
def test_own_ratios_are_what_no_fit_takes_away_and_at_least_three(number: int) -> None:
    data = made(number)
    one, deviations = data.case.instrument, data.case.deviations
    parameters = list(one.curves.rubber.parameters)
    assert set(data.truth["snr_own"]) == set(one.flaws) == set(data.truth["effects"])
    for name in one.flaws:
        trace = (data.case.clean - one.with_sizes({name: 0.0}).reading()) / deviations
        others = [
            (one.reading([v * (1.002 if i == k else 1.0) for i, v in enumerate(parameters)]) - data.case.clean)
            for k in range(len(parameters))
        ]
        for k, f in one.flaws.items():
            if k != name:
                others.append(one.with_sizes({k: 1.01 * f.size}).reading() - data.case.clean)
        columns = np.stack([x / deviations / np.linalg.norm(x / deviations) for x in others], axis=1)
        left = trace - columns @ np.linalg.lstsq(columns, trace, rcond=None)[0]
        assert data.truth["snr_own"][name] == pytest.approx(np.linalg.norm(left), rel=0.02)
        assert data.truth["snr"][name] == pytest.approx(np.linalg.norm(trace))
        assert 3 <= data.truth["snr_own"][name] <= min(100, data.truth["snr"][name])
    z = np.delete((data.read.force - data.case.clean) / deviations, data.truth["strays"])
    # A correlated scatter tells less of its own deviation.
    rho = data.truth["noise"]["rho"]
    spread = np.sqrt((1 + rho**2) / (1 - rho**2) / (2 * z.size))
    rounding = data.truth["noise"]["step"] ** 2 / 12 / np.mean(deviations**2)
    assert np.sqrt(np.mean(z**2)) == pytest.approx(np.sqrt(1 + rounding), abs=4 * spread)


@WITH_ITS_SEED
def test_the_truth_is_told_in_si() -> None:
    data = made(1)
    at = data.path.largest * np.array([0.5, 1.0])
    scales = data.case.instrument.scales
    np.testing.assert_allclose(data.film.force(at)[1], scales.force, rtol=1e-6)
    assert data.film.outer - data.film.inner == pytest.approx(1e-3 * scales.free)
    assert data.truth["expected"] == ["named", "ambiguous", "unknown"]
    assert made(0).truth["expected"] == ["adequate", "material", "unknown"]
    assert made(0).truth["parameters"]["c1"] == pytest.approx(
        0.5 * made(0).truth["shear_modulus"] * 1e-6 * made(0).case.stock.thickness
    )
    play = made(4).truth["effects"]["backlash"]
    assert play["size"] == pytest.approx(play["part"] * made(4).path.largest, rel=1e-5)


# ---- the study -------------------------------------------------------------------------------------------------------


def test_the_plan_holds_the_cases_of_the_generator() -> None:
    cases = list(third_plan())
    assert [c.number for c in cases] == list(range(CASES))
    assert len({c.key for c in (*cases, *third_plan(base=7))}) == 2 * CASES
    assert Counter(c.group for c in cases)["foreign"] == 10
    assert third_measured(cases[20]).csv == made(20).csv
    with pytest.raises(ValueError, match="tuned"):
        next(third_plan("calibration"))


@WITH_ITS_SEED
def test_the_study_declares_the_films_own_energy_or_one_of_the_common_ones(monkeypatch, tmp_path, capsys) -> None:
    asked = []

    def answered(measurement, material):
        asked.append(material)

    said = {"verdict": "unknown", "effects": [], "material": "", "sentence": "s", "probabilities": None}
    said["error"] = {"heldout_coverage_90_after": None, "after": {"reduced_chi2": 2.0}}
    monkeypatch.setattr(reliability, "diagnosed", answered)
    monkeypatch.setattr(reliability, "document", lambda found: said)
    monkeypatch.setattr(reliability, "warmed", lambda: None)
    monkeypatch.setattr(reliability, "terms", lambda found: [("gent", "none", -1.0)])
    file = tmp_path / "results.jsonl"
    call = ["--generator", "third", "--seed", str(SEED), "--first", "18", "--count", "2", "--energy", "both"]
    assert reliability.main([*call, "--results", str(file)]) == 0
    families = [made(n).truth["family"] for n in (18, 19)]
    assert [f in COMMON for f in families] == [False, True]
    assert asked == [COMMON[18 % 5], None, families[1], None]
    rows = list(reliability.stored(file).values())
    assert [r["foreign"] for r in rows] == [["backlash"]] * 2 + [["temperature_step"]] * 2
    assert all(r["truth"] == [] for r in rows)
    assert all(r["material"] != OF_THE_FILM for r in rows)
    assert f"--generator third --energy both --seed {SEED}" in capsys.readouterr().out
