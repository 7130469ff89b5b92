"""A hypothesis is called one way everywhere, also one that this package has never heard of."""

from dataclasses import dataclass
from typing import ClassVar

import pytest

from bayesmembrane.physics.hypothesis import Hypothesis, hypothesis
from bayesmembrane.physics.materials.yeoh import Yeoh
from bayesmembrane.words.hypothesis import effect_title, material_title, spoken, spoken_apart


@dataclass(frozen=True)
class Strange(Yeoh):
    """A stranger's energy without a title."""

    name: ClassVar[str] = "strange_rubber"
    title: ClassVar[str] = ""


@pytest.mark.parametrize(
    ("claim", "words"),
    [
        (hypothesis("yeoh"), "Yeoh"),
        (hypothesis("neo_hookean", ["friction"]), "neo-Hookean with friction in the guide"),
        (
            hypothesis("gent", ["friction", "clamp_slip", "permanent_set"]),
            "Gent with friction in the guide, slip in the clamp and permanent set",
        ),
        (Hypothesis(Strange), "strange rubber"),
    ],
)
def test_material_and_effects_by_their_titles(claim: Hypothesis, words: str) -> None:
    assert spoken(claim) == words


def test_two_that_would_be_called_alike_are_told_apart() -> None:
    white, correlated = hypothesis("yeoh"), hypothesis("yeoh", noise="ar1")
    assert spoken_apart([white, hypothesis("gent")]) == ["Yeoh", "Gent"]
    assert spoken_apart([white, correlated]) == ["Yeoh (white, reached)", "Yeoh (ar1, reached)"]


def test_names_that_nobody_declares_are_still_readable() -> None:
    assert (material_title("neo_hookean"), effect_title("clamp_slip")) == ("neo-Hookean", "slip in the clamp")
    assert (material_title("a_third_party"), effect_title("a_gremlin")) == ("a third party", "a gremlin")
