"""Verbs that are killed in the middle go on after the last piece that is kept, and find the same to the last bit."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from bayesmembrane.campaign.page import write_morning_page
from bayesmembrane.campaign.record import DONE, read_records
from bayesmembrane.ground.pieces import FOLDER
from tests.campaign.films import planned
from tests.comparison.test_interrupted import strip

ROOT = Path(__file__).resolve().parents[2]
LONGEST = 300.0  # s


def called(pieces: int, words: list[str], cwd: Path) -> tuple[int, str, list[str]]:
    """(exit status, what was printed, pieces that were made) of a verb that is killed after so many pieces."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.app.killed", str(pieces), *words],
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


@pytest.mark.study
@pytest.mark.parametrize(
    ("verb", "more"),
    [
        ("valleys", ["--material", "mooney_rivlin"]),
        ("loop", ["--material", "neo_hookean", "--ess", "100"]),
    ],
)
def test_killed_and_asked_again_is_as_if_it_had_not_been(verb: str, more: list[str], tmp_path: Path) -> None:
    curve = strip(tmp_path)
    words = [verb, *curve, *more, "--out", "out", "--json"]
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


@pytest.mark.study
def test_a_worker_killed_in_a_loop_and_a_valley_of_a_campaign(tmp_path: Path) -> None:
    """Whoever takes their tasks finds the same to the last bit, and the page has their row and their links."""
    wanted = {"hypotheses": 'materials = ["neo_hookean"]', "analyses": 'wanted = ["valleys", "loop"]\npages = false'}
    calm, shot = (planned(tmp_path / name, films=("a",), **wanted)[0] for name in ("calm", "shot"))
    status, _, every = called(0, ["tasks", str(calm)], tmp_path)
    assert status == 0
    made: list[str] = []
    for most in (2, len(every) - 4):
        status, _, some = called(most, ["tasks", str(shot)], tmp_path)
        assert status == -signal.SIGKILL
        made += some
    status, _, rest = called(0, ["tasks", str(shot)], tmp_path)
    assert (status, made + rest) == (0, every), "no piece is made twice"
    found, undisturbed = read_records(shot), read_records(calm)
    assert [r.state for r in found.values()] == [DONE, DONE]
    assert {k: (r.state, r.found) for k, r in found.items()} == {k: (r.state, r.found) for k, r in undisturbed.items()}
    assert arrays(shot) == arrays(calm) != {}
    (row,) = json.loads(write_morning_page(shot).with_name("report.json").read_text())["rows"]
    assert row["states"] == {"valleys": DONE, "loop": DONE}
    assert {(shot / row["links"][name]).is_dir() for name in ("valleys", "loop")} == {True}
    assert row["verdict"]


def arrays(campaign: Path) -> dict[str, bytes]:
    """What answers hold in numbers."""
    kinds = ("valleys.npz", "loop.npz")
    return {str(p.relative_to(campaign)): p.read_bytes() for kind in kinds for p in (campaign / "films").rglob(kind)}
