"""A small fixed part of `make study-kill`."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.study
def test_killed_runs_end_as_if_they_had_not_been() -> None:
    words = [sys.executable, "-m", "tests.studies.kill", "--kills", "3", "--steps", "40", "--seed", "5"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "| SIGKILLs | 3 |" in done.stdout
