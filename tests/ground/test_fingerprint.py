"""What a run reaches of the source: all that can change its draws, and nothing else."""

import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from bayesmembrane.calibration.fingerprint import SAMPLING
from bayesmembrane.ground import fingerprint
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.fingerprint import ROOT, digest, majors, reached
from bayesmembrane.physics.effects.base import Sensor
from bayesmembrane.physics.effects.zero_offset import ZeroOffset
from bayesmembrane.physics.materials.gent import Gent
from bayesmembrane.physics.noise.white import White
from bayesmembrane.physics.rigs.annulus import Annulus

OWN = (Gent, ZeroOffset, White, Annulus)
PACKAGE = ROOT / "bayesmembrane"


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("tree")
    shutil.copytree(PACKAGE, root / "bayesmembrane", ignore=shutil.ignore_patterns("__pycache__", "_data"))
    return root


@pytest.fixture
def changed(copied: Path) -> Callable[[str, Callable[[str], str]], bool]:
    """Whether a change of one file, undone afterwards, changes what a run reaches."""

    def changes(name: str, change: Callable[[str], str]) -> bool:
        path, before = copied / "bayesmembrane" / name, reached(SAMPLING, OWN, copied)
        text = path.read_text(encoding="utf-8") if path.exists() else None
        new = change(text or "")
        assert new != text, "the test must change something"
        try:
            path.write_text(new, encoding="utf-8")
            return reached(SAMPLING, OWN, copied) != before
        finally:
            path.unlink() if text is None else path.write_text(text, encoding="utf-8")

    return changes


def test_the_copied_tree_is_this_one(copied: Path) -> None:
    assert reached(SAMPLING, OWN, copied) == reached(SAMPLING, OWN)


def test_comments_docstrings_and_layout_change_nothing_in_any_file(copied: Path) -> None:
    before = reached(SAMPLING, OWN, copied)
    paths = [copied.joinpath(*name.split(".")) for name in before]
    files = [p.with_suffix(".py") if p.with_suffix(".py").is_file() else p / "__init__.py" for p in paths]
    texts = [f.read_text(encoding="utf-8") for f in files]
    try:
        for file, text in zip(files, texts, strict=True):
            said = re.sub(r'^"""', '"""Said otherwise. ', text, count=1)
            file.write_text(f"# A comment.\n{said}\n\n\n# Another one.\n", encoding="utf-8")
        assert reached(SAMPLING, OWN, copied) == before
    finally:
        for file, text in zip(files, texts, strict=True):
            file.write_text(text, encoding="utf-8")


def statement(text: str) -> str:
    return f"{text}\nNEW = 1\n"


@pytest.mark.parametrize(
    "name",
    [
        "physics/materials/new.py",
        "physics/materials/yeoh.py",
        "physics/effects/new.py",
        "physics/effects/clamp_slip.py",
        "physics/noise/ar1.py",
        "physics/rigs/biaxial.py",
        "data/importers/csv_toml.py",
        "words/sampling.py",
        "report/page.py",
        "app/cli.py",
        "comparison/compare.py",
        "calibration/predictions.py",
        "calibration/run.py",
        "calibration/store.py",
        "__init__.py",
    ],
)
def test_what_a_run_does_not_reach_may_change(changed: Callable[..., bool], name: str) -> None:
    assert not changed(name, statement)


@pytest.mark.parametrize(
    "name",
    [
        "ground/parameters.py",
        "physics/materials/gent.py",
        "physics/materials/base.py",
        "physics/effects/zero_offset.py",
        "physics/noise/white.py",
        "physics/rigs/annulus.py",
        "physics/mechanics/ritz/kernels.py",
        "physics/mechanics/shooting/kernels.py",
        "physics/mechanics/convexity_kernels.py",
        "physics/forward.py",
        "calibration/posterior.py",
        "calibration/starts.py",
        "calibration/goodness.py",
        "calibration/sampling/walk.py",
        "calibration/sampling/convergence.py",
        "calibration/sampling/proposals/ensemble.py",
        "calibration/sampling/proposals/emulator.py",
    ],
)
def test_what_a_run_reaches_may_not(changed: Callable[..., bool], name: str) -> None:
    assert changed(name, statement)


def test_a_single_number_of_a_kernel_counts(changed: Callable[..., bool]) -> None:
    assert changed("physics/mechanics/ritz/kernels.py", lambda text: re.sub(r"\b0\.5\b", "0.50001", text, count=1))


def test_the_order_of_operands_counts_and_what_stands_in_them(tmp_path: Path) -> None:
    texts = [
        "a[b:]",
        "a[:b]",
        "f(a)(b)",
        "f(a, b)",
        "f(a, (b))",
        "f((a, b))",
        "a - b",
        "b - a",
        "'''text''' + a",
        "None",
        "not a",
    ]
    found = []
    for text in texts:
        (tmp_path / "bayesmembrane").mkdir(exist_ok=True)
        (tmp_path / "bayesmembrane" / "one.py").write_text(f"x = {text}\n")
        found.append(reached(["bayesmembrane.one"], (), tmp_path)["bayesmembrane.one"])
    assert found[3] == found[4]
    assert len(set(found)) == len(texts) - 1


def test_imports_at_any_depth_are_followed_but_not_those_for_type_checkers(tmp_path: Path) -> None:
    package = tmp_path / "bayesmembrane" / "room"
    package.mkdir(parents=True)
    for name in ("lazy", "typed", "relative", "beside"):
        (package / f"{name}.py").write_text("")
    (package / "__init__.py").write_text("from . import beside\n")
    (package / "entry.py").write_text(
        "from typing import TYPE_CHECKING\nfrom .relative import x\n"
        "if TYPE_CHECKING:\n    import bayesmembrane.room.typed\n"
        "def f():\n    with g() as h:\n        from bayesmembrane.room import lazy\n"
    )
    names = reached(["bayesmembrane.room.entry"], (), tmp_path)
    assert set(names) == {f"bayesmembrane.room{n}" for n in ("", ".entry", ".lazy", ".relative", ".beside")}


def test_a_component_of_another_package_counts_with_what_it_imports(tmp_path: Path) -> None:
    package = tmp_path / "their_films"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "tools.py").write_text("FACTOR = 2.0\n")
    (package / "sensor.py").write_text(
        "from bayesmembrane.physics.effects.base import Sensor\nfrom their_films import tools\n"
        "class Theirs(Sensor):\n    name = 'theirs'\n"
    )
    sys.path.insert(0, str(tmp_path))
    try:
        from their_films.sensor import Theirs  # type: ignore[import-not-found]

        before = reached(SAMPLING, [Gent, Theirs])
        assert {"their_films.sensor", "their_films.tools", "bayesmembrane.physics.effects.base"} <= before.keys()
        (package / "tools.py").write_text("FACTOR = 3.0\n")
        assert reached(SAMPLING, [Gent, Theirs]) != before
    finally:
        sys.path.remove(str(tmp_path))
        for name in [n for n in sys.modules if n.startswith("their_films")]:
            del sys.modules[name]


def test_a_class_without_a_file_has_a_fingerprint_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a notebook: its source where Python knows it, and otherwise nothing that another process could match."""
    module = ModuleType("notebook")
    monkeypatch.setitem(sys.modules, "notebook", module)
    typed = type("Typed", (Sensor,), {"__module__": "notebook"})
    found = reached(SAMPLING, [typed])
    assert found["notebook.Typed"].startswith(fingerprint._PROCESS)
    assert found == reached(SAMPLING, [typed])


def test_what_is_kept_of_parsing_is_no_answer_by_itself(copied: Path) -> None:
    """A file of kept digests that is damaged costs time and nothing else."""
    before = reached(SAMPLING, OWN, copied)
    (kept,) = (copied / "bayesmembrane" / "__pycache__").glob("fingerprint*.json")
    kept.write_text("[garbage")
    fingerprint._kept.cache_clear()
    assert reached(SAMPLING, OWN, copied) == before


def test_an_entry_that_is_not_there_is_told() -> None:
    with pytest.raises(StorageError, match=r'no module "bayesmembrane\.nothing"'):
        reached(["bayesmembrane.nothing"])


@pytest.mark.parametrize("package", ["emcee", "numpy"])
def test_a_major_version_counts_and_a_minor_one_does_not(monkeypatch: pytest.MonkeyPatch, package: str) -> None:
    before, real = majors(), fingerprint.installed

    def upgraded(to: str) -> Callable[[str], str]:
        return lambda name: to if name == package else real(name)

    major = int(before[package])
    monkeypatch.setattr(fingerprint, "installed", upgraded(f"{major}.999.1"))
    assert majors() == before
    monkeypatch.setattr(fingerprint, "installed", upgraded(f"{major + 1}.0.0"))
    assert digest(majors()) != digest(before)
