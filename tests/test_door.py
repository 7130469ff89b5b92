"""The door: what ``import bayesmembrane as bm`` offers, what it costs, and that it says nothing by itself."""

from __future__ import annotations

import ast
import inspect
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any, cast

import pytest

import bayesmembrane as bm
from bayesmembrane.app import door
from bayesmembrane.data.shipped import data_folder

ROOT = Path(__file__).resolve().parent.parent
VERBS = [name for name in bm.__all__ if not name.endswith("Error")]


def run(*words: str, home: Path) -> subprocess.CompletedProcess[str]:
    """Python in a fresh process, where arviz has not warned yet today."""
    environment = {
        **os.environ,
        "XDG_CACHE_HOME": str(home),
        "MPLCONFIGDIR": str(home / "mpl"),
        "PYTHONPATH": str(ROOT),
    }
    return subprocess.run(
        [sys.executable, *words], env=environment, capture_output=True, text=True, timeout=3000, check=False, cwd=home
    )


@pytest.mark.parametrize("name", VERBS)
def test_every_verb_is_there_and_says_what_it_does(name: str) -> None:
    assert callable(getattr(bm, name))
    assert inspect.signature(getattr(bm, name)) == inspect.signature(getattr(door, name))
    assert name in dir(bm)
    assert getattr(door, name).__doc__


def test_what_type_checkers_are_told_is_what_is_there() -> None:
    tree = ast.parse((ROOT / "bayesmembrane" / "__init__.py").read_text())
    stubs = {a.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for a in node.names}
    assert set(bm.__all__) <= stubs


def test_a_room_of_a_verb_s_name_is_still_a_package() -> None:
    import bayesmembrane.report.page
    import bayesmembrane.valleys.result

    assert callable(bm.valleys)
    assert callable(bm.report)
    assert bayesmembrane.valleys.result.Valleys.__name__ == "Valleys"
    assert bayesmembrane.report.page.write_report


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="'bayesmembrane' has no attribute 'fitt'"):
        _ = bm.fitt  # type: ignore[attr-defined]


def test_the_name_of_an_energy_is_a_hypothesis() -> None:
    """Of one test and of several; a wrong one is refused in a sentence that lists all."""
    folder = data_folder()
    one, other = (bm.read(folder / f"meunier_{n}.csv", folder / f"meunier_{n}.toml") for n in ("uniaxial", "planar"))
    for tests in (one, [one, other]):
        named, built = bm.fit(tests, "neo_hookean"), bm.fit(tests, bm.hypothesis("neo_hookean"))
        assert bm.as_dict(named)["parameters"] == bm.as_dict(built)["parameters"]
        with pytest.raises(bm.SettingsError, match="neo_hookean"):
            bm.fit(tests, "neohookean")


def test_the_import_is_cheap_and_silent(tmp_path: Path) -> None:
    """Not a third party is loaded that a user would wait for, and no warning passes."""
    done = run("-W", "error", "-c", "import bayesmembrane, sys; print(*sys.modules)", home=tmp_path)
    assert done.stderr == ""
    assert not {"numpy", "scipy", "numba", "arviz", "matplotlib", "typer", "rich"} & set(done.stdout.split())


def test_the_help_loads_nothing_that_computes(tmp_path: Path) -> None:
    program = "import sys; import bayesmembrane.app.cli as c; c.assembled(); print(*sys.modules)"
    loaded = set(run("-c", program, home=tmp_path).stdout.split())
    assert not {"numpy", "scipy", "numba", "arviz", "matplotlib", "rich.table"} & loaded


def test_everything_behind_the_door_is_imported_without_a_word(tmp_path: Path) -> None:
    done = run("-c", "import bayesmembrane as bm; bm.fit, bm.report, bm.sample", home=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


# Walks short enough for a test, one effect at most, and no picture: what they are worth is tested where they are made.
SHORTLY = """\
from bayesmembrane.comparison import compare
from bayesmembrane.diagnosis.explanation.case import Question
from tests.report.blank import blank
from tests.short_walks import shorten
shorten()
blank()
Question.__init__.__defaults__ = (True, True)
compare.cores = lambda: 1
"""


def test_the_lines_of_the_readme_run(tmp_path: Path) -> None:
    """As they stand there, from a folder in which the shipped data lie."""
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / "README.md").read_text(), re.MULTILINE | re.DOTALL)
    (lines,) = [block for block in blocks if "import bayesmembrane as bm" in block]
    assert 8 <= len([line for line in lines.splitlines() if line.strip()]) <= 12
    (tmp_path / "data").symlink_to(data_folder())
    done = run("-c", SHORTLY + lines, home=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    page = Path(tmp_path / done.stdout.strip().splitlines()[-1])
    assert page.read_text(encoding="utf-8").lstrip().lower().startswith("<!doctype html")


def test_what_is_no_run_makes_no_population() -> None:
    for wrong, told in (([], "no run to make a population of"), (["chains/x"], "'chains/x' is no run")):
        with pytest.raises(bm.BayesmembraneError, match=told):
            bm.population(cast(Any, wrong))
