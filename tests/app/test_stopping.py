"""Signals at the command line: what was walked is stored, the command that goes on is printed, and it does."""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bayesmembrane.calibration.sampling.segments import Segments
from tests.comparison.test_interrupted import strip

ROOT = Path(__file__).resolve().parents[2]
LONGEST = 300.0  # s, for what takes a few; compiled code may have to be made first


def begun(words: list[str], program: str = "bayesmembrane", cwd: Path = ROOT) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-m", program, *words],
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize("number", [signal.SIGTERM, pytest.param(signal.SIGINT, marks=pytest.mark.study)])
def test_sample_is_stopped_and_goes_on(number: int, tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = ["sample", *strip(tmp_path), "--material", "neo_hookean", "--out", str(out), "--json"]
    first = begun([*words, "--ess", "1e7"])
    give_up = time.monotonic() + LONGEST
    while not list(out.glob("*/segments/*.seg")):
        assert time.monotonic() < give_up
        assert first.poll() is None, first.communicate()
        time.sleep(0.05)
    os.kill(first.pid, number)
    told, err = first.communicate(timeout=LONGEST)
    assert first.returncode == 130, err
    assert not told
    assert "Traceback" not in err
    assert shlex.split(err.split("The same command resumes it: ")[1].split("\n")[0])[1:] == [*words, "--ess", "1e7"]
    (run,) = out.glob("*/status.json")
    before = json.loads(run.read_text())
    assert before["status"] == "interrupted"
    assert before["steps"] > 0


@pytest.mark.parametrize(
    ("verb", "number", "begins"),
    [("loop", signal.SIGTERM, "*.seg"), pytest.param("demo", signal.SIGINT, "*", marks=pytest.mark.study)],
)
def test_verbs_of_many_runs_are_stopped_and_say_how_to_go_on(
    verb: str, number: int, begins: str, tmp_path: Path
) -> None:
    """A loop in its first run, the demonstration as soon as its workers write something, which takes a while."""
    chains = tmp_path / "chains"
    asked = [*strip(tmp_path), "--material", "neo_hookean"] if verb == "loop" else []
    words = [verb, *asked, "--chains" if verb == "demo" else "--out", str(chains)]
    process = begun(words, "tests.comparison.short_compare", tmp_path)
    give_up = time.monotonic() + LONGEST
    while not list(chains.rglob(begins)):
        assert time.monotonic() < give_up
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    os.kill(process.pid, number)
    _, err = process.communicate(timeout=LONGEST)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    assert shlex.split(err.split("The same command resumes it: ")[1].split("\n")[0])[1:] == words
    for run in chains.rglob("run.toml"):
        list(Segments(run.parent))  # raises for one that is damaged
