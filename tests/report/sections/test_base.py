"""A section of another package appears on the page: writing one class is enough."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest

from bayesmembrane.ground import registry
from bayesmembrane.report.blocks import Block, Column, Table, Text
from bayesmembrane.report.page import PAGE, TWIN, sections, write_report
from bayesmembrane.report.runs import Shown
from bayesmembrane.report.sections.base import Glance, Section, Subject, of_kind


@dataclass(frozen=True)
class Smell:
    """A result that this program has never heard of."""

    strength: float


class SmellSection(Section):
    """What another package says of it."""

    name = "smell"
    title = "The smell <of> the film"
    order = 35.5
    shows = Smell

    def reads(self, folder: Path) -> Any | None:
        found = folder / "smell.json"
        return Smell(json.loads(found.read_text())["strength"]) if found.is_file() else None

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        found = of_kind(results, Smell)
        rows = tuple((s.strength,) for s in found)
        return (
            [Text("It smells."), Table("smell", "Strength.", (Column("strength", "strength (-)"),), rows)]
            if found
            else []
        )

    def answer(self, results: Sequence[Any]) -> Sequence[str]:
        return [f"It smells {s.strength:g} times." for s in of_kind(results, Smell)]

    def warnings(self, results: Sequence[Any]) -> Sequence[str]:
        return ["Open a window."] if of_kind(results, Smell) else []

    def glances(self, results: Sequence[Any]) -> Sequence[Glance]:
        return [Glance("smell", "the film", f"{s.strength:g}") for s in of_kind(results, Smell)]

    def subject(self, results: Sequence[Any]) -> Subject | None:
        return Subject(("a film",), "A smell.") if of_kind(results, Smell) else None


@pytest.fixture
def plugged(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same class, declared as another package declares it."""
    group = "bayesmembrane.sections"
    point = EntryPoint("smell", f"{__name__}:SmellSection", group)
    monkeypatch.setattr(EntryPoint, "load", lambda self: SmellSection)
    monkeypatch.setattr(registry, "entry_points", lambda *, group: [point] if group == point.group else [])
    registry._discover.cache_clear()
    yield
    registry._discover.cache_clear()


@pytest.mark.usefixtures("blank_pictures")
def test_a_plugged_section_stands_where_its_order_says(plugged: None, tmp_path: Path, yeoh: Shown) -> None:
    assert "smell" in [s.name for s in sections()]
    text = write_report([yeoh, Smell(3.0)], tmp_path).read_text()
    twin = json.loads((tmp_path / TWIN).read_text())
    assert text.index('id="curves"') < text.index('id="smell"') < text.index('id="comparison"')
    assert "The smell &lt;of&gt; the film" in text
    assert twin["tables"]["smell"] == [{"strength": 3.0}]
    assert "It smells 3 times." in twin["answer"]
    assert twin["warnings"] == ["Open a window."]


@pytest.mark.usefixtures("blank_pictures")
def test_a_plugged_section_reads_its_folder(plugged: None, tmp_path: Path) -> None:
    (tmp_path / "answers" / "one").mkdir(parents=True)
    (tmp_path / "answers" / "one" / "smell.json").write_text('{"strength": 2.0}')
    page = write_report([tmp_path / "answers"], tmp_path / "report")
    assert json.loads(page.with_name(TWIN).read_text())["answer"] == ["It smells 2 times."]
    assert "What the force curve of a film says" in page.read_text()
    assert page.name == PAGE


def test_one_result_alone_is_text_and_html() -> None:
    section = SmellSection()
    assert section.text(Smell(1.0)) == "The smell <of> the film\nIt smells 1 times."
    html = section.html(Smell(1.0))
    assert "<p>It smells.</p>" in html
    assert "<html" not in html


def test_every_section_says_nothing_where_there_is_nothing() -> None:
    for section in sections():
        assert not section.parts([])
        assert not section.answer([])
        assert not section.warnings([])
        assert not section.glances([])
        assert section.subject([]) is None


def test_no_two_sections_share_a_name_an_order_or_a_type() -> None:
    every = sections()
    shown = [s.shows for s in every if s.shows is not None]
    assert len({s.name for s in every}) == len({s.order for s in every}) == len(every)
    assert len(set(shown)) == len(shown)
