"""Verbs that are killed in the middle go on after the last piece that is kept, and find the same to the last bit."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from bayesmembrane.ground.pieces import FOLDER
from tests.comparison.test_interrupted import strip

ROOT = Path(__file__).resolve().parents[2]
LONGEST = 300.0  # s


def called(pieces: int, words: list[str], cwd: Path) -> tuple[int, str, list[str]]:
    """(exit status, what was printed, pieces that were made) of a verb that is killed after so many pieces."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.app.killed", str(pieces), *words, "--out", "out", "--json"],
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=LONGEST,
        check=False,
    )
    assert "Traceback" not in done.stderr, done.stderr
    made = [line.split(" ", 1)[1] for line in done.stderr.splitlines() if line.startswith("piece ")]
    return done.returncode, done.stdout, made


@pytest.mark.parametrize(
    ("verb", "more"),
    [("valleys", ["--material", "mooney_rivlin"]), ("loop", ["--material", "neo_hookean", "--ess", "100"])],
)
def test_killed_and_asked_again_is_as_if_it_had_not_been(verb: str, more: list[str], tmp_path: Path) -> None:
    curve = strip(tmp_path)
    words = [verb, *curve, *more]
    quiet, disturbed = tmp_path / "quiet", tmp_path / "disturbed"
    quiet.mkdir()
    disturbed.mkdir()
    status, answer, every = called(0, words, quiet)
    assert status == 0
    assert len(every) == len(set(every)) > 1
    assert called(1, words, disturbed) == (-signal.SIGKILL, "", every[:1])
    damaged = next((disturbed / "out").glob(f"*/{FOLDER}/{every[0]}.npz"))
    whole = damaged.read_bytes()
    assert called(len(every) - 2 or 1, words, disturbed)[2][0] == every[1]
    damaged.write_bytes(whole[: len(whole) // 2])
    status, again, made = called(0, words, disturbed)
    assert (status, again) == (0, answer)
    assert made[0] == every[0], "a piece that is damaged is made again"
    assert len(made) == 1 + len(every) - (1 + (len(every) - 2 or 1))
    assert not list((disturbed / "out").glob(f"*/{FOLDER}")), "the answer is there, and its pieces are gone"
