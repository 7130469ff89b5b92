"""A project file lists tests, and says in a sentence what is wrong with it."""

from pathlib import Path

import pytest

from bayesmembrane.data.project import read_project
from bayesmembrane.data.shipped import shipped
from bayesmembrane.ground.errors import DataError

CURVE = "stretch,nominal_stress_MPa\n1.1,0.05\n1.2,0.09\n1.3,0.12\n"
FILM = '[specimen]\nname = "Film 1"\nthickness_um = 500\n[rig]\nkind = "uniaxial"\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "a.csv").write_text(CURVE)
    (tmp_path / "a.toml").write_text(FILM)
    return tmp_path


def project(folder: Path, text: str) -> Path:
    path = folder / "project.toml"
    path.write_text(text)
    return path


TEST = '[[test]]\ncurve = "a.csv"\nspecimen = "a.toml"\n'


def test_tests_are_listed_with_what_is_said_of_each(folder: Path) -> None:
    text = TEST + TEST + 'name = "second"\neffects = "zero_offset"\nnoise = "form"\nmax_deflection_mm = 11\n'
    first, second = read_project(project(folder, text))
    assert (first.label, first.effects, first.noise, len(first.measurement)) == ("", None, None, 3)
    assert (second.label, second.effects, second.noise, len(second.measurement)) == ("second", "zero_offset", "form", 2)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("test = 3\n", "lists no tests"),
        ('[test]\ncurve = "a.csv"\n', "lists no tests"),
        ('[[test]]\ncurve = "a.csv"\n', "specimen"),
        (TEST + "effects = 3\n", "effects must be a text"),
        (TEST + 'wieght = "2"\n', '"wieght" is unknown'),
        ("extra = 1\n" + TEST, '"extra" is unknown'),
        (TEST.replace("a.csv", "b.csv"), "b.csv"),
    ],
)
def test_faults_are_said_in_a_sentence(folder: Path, text: str, match: str) -> None:
    with pytest.raises(DataError, match=match):
        read_project(project(folder, text))


def test_the_project_that_ships_has_three_modes_of_one_silicone() -> None:
    found = read_project(shipped("meunier.toml"))
    assert [(t.label, t.measurement.rig.name, len(t.measurement)) for t in found] == [
        ("uniaxial", "uniaxial", 33),
        ("planar", "planar", 19),
        ("equibiaxial", "equibiaxial", 14),
    ]
    assert found[0].measurement.deflection.min() < 0  # compression, too
    assert all("MIT" in t.measurement.provenance.origin for t in found)
