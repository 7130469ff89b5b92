"""The fourth generator: its cases are shared out as said, follow from their seed, and are read back."""

import ast
from collections import Counter
from functools import cache
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.data.reading import read_measurement
from bayesmembrane.ground.registry import components
from tests.generator_four.datasets import BenchDataset, generate
from tests.generator_four.faults import FOREIGN_FAULTS, KNOWN_FAULTS
from tests.generator_four.recipes import CASES, recipes
from tests.generator_three.energies import COMMON
from tests.studies import reliability
from tests.studies.reliability_plan import fourth_measured, fourth_plan
from tests.studies.reliability_rows import truth_row

FOLDER = Path(__file__).parent
SEED = 1
SOME = ("none", "one", "two", "three", "foreign")
SHARED = {f"tests.generator_three.{name}" for name in ("elements", "energies", "curves", "visibility", "instrument")}


@cache
def made(number: int) -> BenchDataset:
    return generate(next(islice(recipes(SEED), number, None)))


def first_of(group: str) -> int:
    return next(r.number for r in recipes(SEED) if r.group == group)


def test_it_shares_the_film_and_the_measure_of_visibility_and_nothing_else() -> None:
    files = [f for f in FOLDER.glob("*.py") if not f.name.startswith("test_")]
    assert len(files) > 8
    for file in files:
        nodes = list(ast.walk(ast.parse(file.read_text())))
        names = {a.name for n in nodes if isinstance(n, ast.Import) for a in n.names}
        names |= {n.module or "." for n in nodes if isinstance(n, ast.ImportFrom)}
        for name in names - SHARED:
            assert name.startswith("tests.generator_four") or name.partition(".")[0] in {
                *("__future__", "collections", "dataclasses", "functools", "pathlib", "typing", "numpy", "scipy"),
            }, name


def test_names_are_those_of_the_library_where_it_has_them() -> None:
    library = components("effects")
    assert set(KNOWN_FAULTS) <= set(library)
    assert not set(FOREIGN_FAULTS) & set(library)


def test_shares_are_exact_for_any_seed() -> None:
    for seed in (1, 2):
        all_ = list(recipes(seed))
        assert [r.number for r in all_] == list(range(CASES))
        assert Counter(r.group for r in all_) == {"none": 13, "one": 19, "two": 16, "three": 7, "foreign": 5}
        assert Counter(r.group for r in all_ if not r.common_energy) == {"none": 5, "one": 5}
        assert sum(r.noise.stated for r in all_) == CASES // 2
        assert not any(r.noise.stated and r.noise.proportional for r in all_)


@pytest.mark.parametrize("group", SOME)
def test_a_case_is_as_its_recipe_says(group: str) -> None:
    number = first_of(group)
    data, recipe = made(number), next(islice(recipes(SEED), number, None))
    truth = data.truth
    assert len(truth["effects"]) == recipe.fault_count
    assert set(truth["snr"]) == set(truth["snr_own"]) == set(truth["effects"])
    assert (truth["family"] in COMMON) == recipe.common_energy
    assert truth["declared"] in COMMON
    own = list(truth["snr_own"].values())
    assert all(0.8 < v < 230 for v in own)
    assert max(own, default=1) / min(own, default=1) < 6.5
    assert (set(truth["effects"]) <= set(FOREIGN_FAULTS)) == (recipe.group in ("foreign", "none"))
    scatter = data.read.force - data.case.clean
    scatter[list(data.read.strays)] = 0
    assert scatter.std() == pytest.approx(truth["noise"]["sd"], rel=0.5)


def test_the_same_seed_gives_the_same_files_and_another_one_others() -> None:
    first = next(recipes(SEED))
    assert generate(first).csv == made(0).csv
    assert generate(first).toml == made(0).toml
    assert generate(next(recipes(SEED + 1))).csv != made(0).csv


@pytest.mark.parametrize("group", SOME)
def test_files_are_read_back(group: str, tmp_path: Path) -> None:
    data = made(first_of(group))
    found = read_measurement(*data.write(tmp_path))
    assert len(found.force) == len(data.read.force)
    assert found.force == pytest.approx(data.read.force, rel=1e-6)
    assert found.deflection == pytest.approx(1e-3 * data.path.at, abs=1e-12)
    assert getattr(found.rig, "inner_radius") == pytest.approx(data.film.inner)  # noqa: B009


def test_the_sound_film_is_told_in_si() -> None:
    data = made(first_of("none"))
    assert data.truth["kind"] == "none"
    force = data.film.force(1e-3 * data.path.at)
    assert force == pytest.approx(data.case.clean, abs=1e-9 + 1e-6 * data.case.clean.max())
    assert np.all(np.diff(data.film.force(np.linspace(0, data.path.largest, 9))) > 0)


def test_the_study_takes_its_cases_from_here() -> None:
    cases = list(fourth_plan())
    assert len({case.key for case in cases}) == CASES
    assert Counter(case.group for case in cases) == {
        **{"null": 8, "energy": 5, "single": 14, "mixed": 5},
        **{"pair": 16, "triple": 7, "foreign": 5},
    }
    number = first_of("foreign")
    assert fourth_measured(cases[number]).csv == made(number).csv
    truth = made(number).truth
    row = truth_row(truth | {"snr_own": dict.fromkeys(truth["effects"], 9.0)}, None)
    assert row["foreign"]
    assert not row["truth"]
    assert reliability.FOURTH in reliability.SOURCES
    with pytest.raises(ValueError, match="no half"):
        next(fourth_plan("test"))
