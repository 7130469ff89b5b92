"""Every material has a look of its own, and every parameter a name for axes."""

from dataclasses import dataclass
from typing import ClassVar

import pytest

from bayesmembrane.ground import registry
from bayesmembrane.physics.materials.yeoh import Yeoh
from bayesmembrane.report.style import PALETTE, colour, linestyle, look, marker, symbol
from bayesmembrane.words.hypothesis import material_title


@dataclass(frozen=True)
class Stranger(Yeoh):
    """Another package's energy, which brings its title and its colour."""

    name: ClassVar[str] = "stranger"
    title: ClassVar[str] = "Stranger's law"
    colour: ClassVar[str] = "#123456"


def test_a_material_keeps_its_colour_and_has_its_own() -> None:
    names = ["neo_hookean", "mooney_rivlin", "gent", "yeoh", "ogden"]
    assert len({colour(n) for n in names}) == 5
    assert colour("a_third_party_material") == colour("a_third_party_material")
    assert linestyle("a_third_party_material") != "-"
    assert len({(linestyle(n), marker(n)) for n in names}) == 5


def test_a_strangers_material_brings_its_own_colour_and_title(monkeypatch: pytest.MonkeyPatch) -> None:
    known = registry.components("materials")
    monkeypatch.setattr(registry, "_discover", lambda group: {**known, "stranger": Stranger})
    assert colour("stranger") == "#123456"
    assert look("stranger").marker in {kind.marker for kind in PALETTE}
    assert material_title("stranger") == "Stranger's law"


def test_effects_change_the_look() -> None:
    assert look("neo_hookean+zero_offset") != look("neo_hookean")
    assert colour("neo_hookean+zero_offset") not in {colour(n) for n in registry.ordinary_materials()}


@pytest.mark.parametrize(
    ("name", "mathematical"),
    [
        ("yeoh.c1", "$c_{1}$"),
        ("yeoh.c2_c1", "$c_{2}/c_{1}$"),
        ("gent.ln_jm", r"$\ln\,J_m$"),
        ("ogden.ln_gd", r"$\ln\,Gd$"),
        ("noise.sd", "extra noise"),
        ("zero_offset.shift", "shift"),
    ],
)
def test_parameters_have_names_for_figures(name: str, mathematical: str) -> None:
    assert symbol(name) == mathematical
