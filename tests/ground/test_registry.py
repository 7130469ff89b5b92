"""The registry finds components by their files and by entry points, and survives other people's mistakes."""

from __future__ import annotations

import sys
import types
import warnings
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from typing import ClassVar

import pytest

from bayesmembrane.ground import registry
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.materials.neo_hookean import NeoHookean


@dataclass(frozen=True)
class Foreign(NeoHookean):
    """W = c1 K, under another name; G d = 2 c1."""

    name: ClassVar[str] = "foreign"


@dataclass(frozen=True)
class Impostor(NeoHookean):
    """W = c1 K, under a name that is taken; G d = 2 c1."""

    name: ClassVar[str] = "yeoh"


class Unfinished(Material):
    """Declares nothing."""

    name = "unfinished"


@pytest.fixture
def install(monkeypatch):
    """Pretend that another package declares these objects as materials."""
    module = types.ModuleType("foreign_package")
    monkeypatch.setitem(sys.modules, module.__name__, module)

    def declare(**objects):
        vars(module).update(objects)
        points = [EntryPoint(k, f"foreign_package:{k}", "bayesmembrane.materials") for k in objects]
        if not objects:
            points = [EntryPoint("absent", "no_such_package:Absent", "bayesmembrane.materials")]
        monkeypatch.setattr(registry, "entry_points", lambda group: points if group.endswith(".materials") else [])
        registry._discover.cache_clear()

    yield declare
    monkeypatch.undo()
    registry._discover.cache_clear()


def test_the_five_materials_are_found_by_their_files():
    known = registry.materials()
    assert list(known) == sorted(known)
    assert {"gent", "mooney_rivlin", "neo_hookean", "ogden", "yeoh"} <= set(known)
    for name, material in known.items():
        assert issubclass(material, Material)
        assert material.name == name
        assert registry.material(name) is material


def test_all_energies_are_those_of_the_paper_and_of_other_packages(install):
    """What else ships is there by its name alone; another package's energy joins unless it says otherwise."""
    install(foreign=Foreign)
    ordinary = set(registry.ordinary_materials())
    assert ordinary == {"gent", "mooney_rivlin", "neo_hookean", "ogden", "yeoh", "foreign"}
    assert {"arruda_boyce", "exp_ln", "gent_thomas", "lopez_pamies"} <= set(registry.materials()) - ordinary


def test_the_answer_is_the_callers_to_change():
    registry.materials().clear()
    assert registry.materials()


@pytest.mark.parametrize("group", ["materials", "effects", "noise", "rigs", "importers", "sections"])
def test_every_group_can_be_asked(group):
    for name, found in registry.components(group).items():
        assert found.name == name


def test_unknown_names_suggest_the_nearest():
    with pytest.raises(SettingsError, match='no material called "mooney"; did you mean "mooney_rivlin"'):
        registry.material("mooney")
    with pytest.raises(SettingsError, match="materials"):
        registry.components("material")


def test_an_entry_point_adds_a_material(install):
    install(Foreign=Foreign)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert registry.material("foreign") is Foreign
    assert registry.material("yeoh") is not Impostor


@pytest.mark.parametrize(
    ("thing", "fault"),
    [(Unfinished, "not a complete material"), (42, "not a complete material"), (Impostor, 'its name "yeoh" is taken')],
)
def test_an_entry_point_that_does_not_fit_is_left_out_with_a_sentence(install, thing, fault):
    install(Thing=thing)
    with pytest.warns(RuntimeWarning, match=fault):
        known = registry.materials()
    assert {"gent", "neo_hookean", "yeoh"} <= set(known)
    assert thing not in known.values()


def test_an_entry_point_that_cannot_be_imported_is_left_out_with_a_sentence(install):
    install()
    with pytest.warns(RuntimeWarning, match="no_such_package") as caught:
        assert "yeoh" in registry.materials()
    assert str(caught[0].message).endswith(".")
    assert "\n" not in str(caught[0].message)
