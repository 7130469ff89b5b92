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

from tests.comparison.test_interrupted import strip

ROOT = Path(__file__).resolve().parents[2]
LONGEST = 300.0  # s, for what takes a few; compiled code may have to be made first


def begun(words: list[str]) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-m", "bayesmembrane", *words],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_sample_is_stopped_and_goes_on(number: int, tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = ["sample", *strip(tmp_path), "--material", "neo_hookean", "--out", str(out), "--json"]
    first = begun([*words, "--ess", "1e5"])
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
    assert shlex.split(err.split("The same command resumes it: ")[1].split("\n")[0])[1:] == [*words, "--ess", "1e5"]
    (run,) = out.glob("*/status.json")
    before = json.loads(run.read_text())
    assert before["status"] == "interrupted"
    assert before["steps"] > 0
