"""A hypothesis in words: the one way in which sentences, tables and pictures call a material with its effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from bayesmembrane.ground.registry import components
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.words.language import listed


def spoken(hypothesis: Hypothesis) -> str:
    """Material and effects by their titles: ``Yeoh``, ``Yeoh with slip in the clamp and permanent set``."""
    effects = listed(title(e) for e in hypothesis.effects)
    return title(hypothesis.material) + (f" with {effects}" if effects else "")


def spoken_apart(hypotheses: Sequence[Hypothesis]) -> list[str]:
    """`spoken` of each; with noise model and convexity prior in brackets where two would else be called alike."""
    names = [spoken(h) for h in hypotheses]
    if len(set(names)) == len(names):
        return names
    return [f"{name} ({h.noise.name}, {h.convexity.name})" for name, h in zip(names, hypotheses, strict=True)]


def material_title(name: str) -> str:
    """How a material is printed; of one that nobody declares (any more) its name, with spaces for underscores."""
    return _title("materials", name)


def effect_title(name: str) -> str:
    """How an effect is printed; of one that nobody declares (any more) its name, with spaces for underscores.

    ``zero_offset@strip`` is one in the test called strip.
    """
    own, _, test = name.partition("@")
    return f"{_title('effects', own)} in {test}" if test else _title("effects", own)


def title(component: Any) -> str:
    """The title of a component; of one that declares none its name, with spaces for underscores."""
    return str(getattr(component, "title", "") or component.name.replace("_", " "))


def _title(group: str, name: str) -> str:
    kind = components(group).get(name)
    return title(kind) if kind is not None else name.replace("_", " ")
