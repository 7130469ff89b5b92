"""Odd machines, odd names and odd files: each ends in a sentence or in the answer, and none in a traceback."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest

from bayesmembrane.data.measurement import Provenance, Specimen
from bayesmembrane.ground.text import file_name, showable
from tests.comparison.test_interrupted import strip

ROOT = Path(__file__).resolve().parents[2]
Run = Callable[..., tuple[int, str, str]]
NOWHERE = "/proc/none"  # not even root can write there
UNWRITABLE = {name: NOWHERE for name in ("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "NUMBA_CACHE_DIR")}

# name -> (what follows the verb fit, what the shell adds, exit status, what stderr says)
TABLE: dict[str, tuple[str, str, int, str]] = {
    "full": ("", "> /dev/full", 1, "stdout: the answer cannot be printed (No space left on device)"),
    "full, json": ("--json", "> /dev/full", 1, "stdout: the answer cannot be printed (No space left on device)"),
    "closed, json": ("--json", ">&-", 1, "stdout: the answer cannot be printed (it is closed)"),
    "all closed": ("--json", ">&- 2>&-", 1, ""),
    "no letters": ("", "> out.txt", 0, ""),
    "no home": ("", "> out.txt", 0, ""),
}

# The same for the verb sample, whose files are 1 kB to 1 MB; 40 and 600 kB are left for compiled code, too.
SAMPLED: dict[str, tuple[str, float, int, str]] = {
    "no room": ("--out out", 0, 1, "cannot be written"),
    "40 kB": ("--out out", 40e3, 1, "cannot be written"),
    "600 kB": ("--out out", 600e3, 0, ""),
}

# What is refused before any surroundings matter needs no process of its own: (verb and settings, exit status, stderr).
REFUSED: dict[str, tuple[str, int, str]] = {
    "no folder": ("fit --out /dev/null/x", 1, "/dev/null/x"),
    "seed": ("fit --seed -1", 2, "--seed"),
    "endless": ("sample --ess inf", 1, "an effective sample size of"),
    "no number": ("sample --ess nan", 1, "an effective sample size of"),
}

# Each of these goes the way of another one.
ALIKE = ("full, json", "all closed", "no home", "40 kB")


def some(table: Iterable[str]) -> list[Any]:
    """Names; those that are `ALIKE` are left for studies."""
    return [pytest.param(name, marks=[pytest.mark.study] if name in ALIKE else []) for name in table]


@pytest.mark.parametrize("name", some(TABLE))
def test_surroundings(name: str, tmp_path: Path) -> None:
    more, shell, status, says = TABLE[name]
    strip(tmp_path)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "200"}
    environment |= UNWRITABLE if name == "no home" else {}
    environment |= {"PYTHONIOENCODING": "ascii"} if name == "no letters" else {}
    command = f"'{sys.executable}' -m bayesmembrane fit strip.csv --specimen strip.toml --material neo_hookean {more}"
    done = subprocess.run(
        ["sh", "-c", f"{command} {shell}"], cwd=tmp_path, env=environment, capture_output=True, timeout=300, check=False
    )
    err = done.stderr.decode(errors="replace")
    assert done.returncode == status, err
    assert "Traceback" not in err
    assert says in err


@pytest.mark.parametrize("name", some(SAMPLED))
def test_surroundings_of_a_run(name: str, tmp_path: Path) -> None:
    """A limit on the size of files stands for a disk that is full: nothing beyond it can be written."""
    more, room, status, says = SAMPLED[name]
    words = ["sample", *strip(tmp_path), "--material", "neo_hookean", *more.split()]
    places = {"HOME": tmp_path / "home", "XDG_CACHE_HOME": tmp_path / "cache", "NUMBA_CACHE_DIR": tmp_path / "code"}
    done = subprocess.run(
        [sys.executable, "-m", "tests.comparison.short_compare", *words],
        cwd=tmp_path,
        env={**os.environ, **{k: str(v) for k, v in places.items()}, "PYTHONPATH": str(ROOT), "COLUMNS": "200"},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (int(room),) * 2),
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == status, done.stderr
    assert "Traceback" not in done.stderr
    assert says in done.stderr


@pytest.mark.usefixtures("short_walks")
@pytest.mark.parametrize("name", REFUSED)
def test_a_wrong_setting_is_refused(name: str, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words, status, says = REFUSED[name]
    verb, *more = words.split()
    monkeypatch.setenv("COLUMNS", "200")
    found, _, err = run(verb, *strip(tmp_path), "--material", "neo_hookean", *more)
    assert found == status, err
    assert "Traceback" not in err
    assert says in err


def test_brackets_and_bytes_in_names_are_shown_as_they_are(run: Run, tmp_path: Path) -> None:
    """No markup, and no text: in the folder, in the specimen's name and in the curve's."""
    folder = tmp_path / "a[bold]b[/red]"
    folder.mkdir(parents=True)
    strip(folder)
    curve = os.fsencode(folder) + b"/\xff[b].csv"
    os.rename(os.fsencode(folder / "strip.csv"), curve)
    specimen = folder / "strip.toml"
    specimen.write_text(specimen.read_text().replace("[specimen]", '[specimen]\nname = "film [bold]A[/red]"'))
    words = [sys.executable, "-m", "bayesmembrane", "fit", os.fsdecode(curve), "--specimen", str(specimen)]
    words += ["--material", "neo_hookean", "--out", str(folder / "out")]
    environment = {**os.environ, "COLUMNS": "200"}
    done = subprocess.run(words, cwd=ROOT, env=environment, capture_output=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr.decode(errors="replace")
    assert "\ufffd[b].csv" in done.stdout.decode()
    status, _, err = run("report", folder / "out", "--out", folder / "page")
    assert status == 0, err
    assert (folder / "page" / "index.html").exists()
    assert len(list((folder / "out").glob("film-bold-a-red*"))) == 1


def test_what_cannot_be_shown_of_a_name_is_replaced() -> None:
    """Controls, signs that turn the direction of a line, and bytes that are no text."""
    assert showable("a\x1b[31mb\u202ec\u2066d\x00\x85") == "a\ufffd[31mb\ufffdc\ufffdd\ufffd\ufffd"
    assert showable("µ 膜 \U0001f9ea é\n\tä") == "µ 膜 \U0001f9ea é  ä"
    assert file_name("x\udcff.csv") == "x\ufffd.csv"
    assert Specimen("a\u202eb", 1e-5).name == "a\ufffdb"
    p = Provenance("c\udcff", origin="\x07", notes=("\x1b",))
    assert (p.curve, p.origin, p.notes) == ("c\ufffd", "\ufffd", ("\ufffd",))


@pytest.mark.parametrize("verb", ["fit", "import"])
def test_a_file_without_end_is_told(verb: str, tmp_path: Path) -> None:
    strip(tmp_path)
    words = [sys.executable, "-m", "bayesmembrane", verb, "/dev/zero"]
    words += ["--specimen", str(tmp_path / "strip.toml"), "--material", "gent"] if verb == "fit" else []
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("/dev/zero: the file is larger than 256 MiB")
