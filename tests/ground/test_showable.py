"""Results show themselves as the report's section that knows their type does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from bayesmembrane.ground import showable
from bayesmembrane.ground.showable import Showable


@dataclass(frozen=True, repr=False)
class Found(Showable):
    loss: float
    force: np.ndarray
    names: tuple[str, ...] = ("c1",)
    kind: type = float
    inner: object = object()


class Finer(Found):
    pass


@dataclass(frozen=True, repr=False)
class Taken(Showable):
    loss: float = 0.25


class FoundSection:
    name, shows, takes = "found", Found, (Taken,)

    def text(self, result: Any) -> str:
        return f"Found, loss {result.loss} N"

    def html(self, result: Any) -> str:
        return f"<p>{result.loss} N</p>"


@pytest.fixture
def section(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(showable, "components", lambda group: {"found": FoundSection})


@pytest.mark.usefixtures("section")
def test_a_section_also_speaks_of_what_it_takes() -> None:
    assert repr(Taken()) == "Found, loss 0.25 N"


@pytest.mark.usefixtures("section")
def test_the_section_that_shows_the_type_speaks() -> None:
    for found in (Found(0.5, np.zeros(3)), Finer(0.5, np.zeros(3))):
        assert repr(found) == "Found, loss 0.5 N"
        assert found._repr_html_() == "<p>0.5 N</p>"


def test_without_a_section_the_plain_fields_stand() -> None:
    found = Found(0.5, np.zeros((3, 2)))
    assert repr(found) == "Found(loss=0.5, force=array(3, 2), names=tuple of 1, kind=float, inner=object(...))"
    assert found._repr_html_() is None
