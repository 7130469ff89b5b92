"""The house itself: pins, floors, make targets, shipped data, and a README that tells no tales."""

import ast
import os
import re
import subprocess
import sys
import tomllib
from collections import defaultdict
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from bayesmembrane.data.shipped import data_folder, shipped
from bayesmembrane.ground.errors import SettingsError

ROOT = Path(__file__).resolve().parent.parent
# Of a comparison, whose stored answers carry the name, and of a campaign's page.
KNOWN_TWICE: set[str] = set()
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def pins() -> dict[str, str]:
    lines = [x for x in (ROOT / "constraints.txt").read_text().splitlines() if x and not x.startswith("#")]
    for line in lines:
        assert re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.+!]+", line), f"a pin is a name and a version: {line}"
    return {canonical(name): version for name, version in (line.split("==") for line in lines)}


def canonical(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def imported_by(path: Path) -> set[str]:
    nodes = list(ast.walk(ast.parse(path.read_text())))
    plain = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    froms = {node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module and not node.level}
    return {name.partition(".")[0] for name in plain | froms}


def test_pins_satisfy_what_the_project_requires() -> None:
    project = PROJECT["project"]
    required = [
        *project["dependencies"],
        *project["optional-dependencies"]["test"],
        *PROJECT["build-system"]["requires"],
    ]
    known = pins()
    for requirement in map(Requirement, required):
        assert requirement.specifier.contains(known[canonical(requirement.name)]), requirement


def test_third_party_imports_are_declared() -> None:
    extras = PROJECT["project"]["optional-dependencies"]["cluster"]  # imported where it is asked for
    declared = {canonical(Requirement(r).name) for r in [*PROJECT["project"]["dependencies"], *extras]}
    found = {name for path in (ROOT / "bayesmembrane").rglob("*.py") for name in imported_by(path)}
    packages = packages_distributions()  # a package may be imported under another name than it is installed under
    strange = found - set(sys.stdlib_module_names) - {"bayesmembrane"}
    foreign = {canonical(packages.get(name, [name])[0]) for name in strange}
    assert foreign <= declared, f"imported and not declared: {sorted(foreign - declared)}"


def test_no_file_of_the_house_names_a_registry_or_this_machine() -> None:
    for name in ("constraints.txt", "Makefile", "pyproject.toml", ".ci/run"):
        text = (ROOT / name).read_text()
        assert "://" not in text.replace("https://keepachangelog", ""), name
        assert not re.search(r"--\S*(index|find).(url|links)", text), name
        assert not re.search(r"(?<![\w.)}])/(home|opt|work|root|tmp)\b", text), name


def test_make_targets_exist() -> None:
    makefile = (ROOT / "Makefile").read_text()
    for target in ("install", "demo", "test", "bench", "study", "study-fuzz", "lint", "clean"):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def test_ci_runs_make_test_and_nothing_else() -> None:
    script = ROOT / ".ci" / "run"
    assert os.access(script, os.X_OK)
    commands = [x for x in script.read_text().splitlines() if x and not x.startswith("#")]
    assert commands == ["set -euo pipefail", 'cd "$(dirname "$0")/.."', "make test"]


def test_no_function_outside_compiled_kernels_takes_more_than_six_arguments() -> None:
    many = []
    for path in sorted((ROOT / "bayesmembrane").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and path.name != "kernels.py":
                a = node.args
                names = [x.arg for x in (*a.posonlyargs, *a.args, *a.kwonlyargs) if x.arg not in ("self", "cls")]
                kernel = any("compiled" in ast.unparse(d) for d in node.decorator_list)
                if len(names) > 6 and not kernel:
                    many.append((path.name, node.name, names))
    assert many == []


def test_a_name_of_a_class_means_one_thing() -> None:
    """Whoever reads of a `Candidate` need not ask which."""
    where = defaultdict(list)
    for path in sorted((ROOT / "bayesmembrane").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                where[node.name].append(path.relative_to(ROOT).as_posix())
    twice = {name: places for name, places in where.items() if len(places) > 1}
    assert set(twice) <= KNOWN_TWICE, twice


def test_make_refuses_an_old_python(tmp_path: Path) -> None:
    """A python that fails the version test stops the set-up with one sentence, before anything is made."""
    old = tmp_path / "python"
    old.write_text('#!/bin/sh\n[ "$1" = --version ] && echo Python 3.9.2 && exit 0\nexit 1\n')
    old.chmod(0o755)
    for name in ("Makefile", "pyproject.toml", "constraints.txt"):
        (tmp_path / name).write_text((ROOT / name).read_text())
    done = subprocess.run(
        ["make", "install", f"PYTHON={old}"], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode != 0
    assert "needs Python >= 3.11" in done.stderr
    assert "Python 3.9.2" in done.stderr
    assert not (tmp_path / ".venv").exists()


def test_shipped_files_are_found_or_the_nearest_is_named() -> None:
    assert data_folder().is_dir()
    files = sorted(p for p in data_folder().rglob("*") if p.is_file())
    assert files, "data/ ships the measurements"
    name = files[0].relative_to(data_folder()).as_posix()
    assert shipped(name) == files[0]
    with pytest.raises(SettingsError, match=re.escape(f'did you mean "{name}"')):
        shipped(name[:-1])


def test_readme_names_the_two_commands_and_only_verbs_that_exist() -> None:
    readme = (ROOT / "README.md").read_text()
    first_screen = readme[: readme.index("## ")]
    assert "make demo" in first_screen
    assert "make test" in first_screen
    verbs = re.findall(r"^\| `(\w+)` \|", readme, re.MULTILINE)
    assert len(verbs) >= 8
    program = "from bayesmembrane.app.cli import main; main()"
    environment = {**os.environ, "COLUMNS": "120", "NO_COLOR": "1"}
    done = subprocess.run(
        [sys.executable, "-c", program, "--help"], env=environment, capture_output=True, text=True, check=True
    )
    for verb in verbs:
        assert re.search(rf"\b{verb}\b", done.stdout), f"the README names {verb}"
    for shown in re.findall(r"^bayesmembrane (\w+)", readme, re.MULTILINE):
        assert shown in verbs
