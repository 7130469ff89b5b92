"""``campaign`` on the command line: what it answers, that it goes on, and that the answers are those of serial runs."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from bayesmembrane.app.analyses import Work
from bayesmembrane.app.cli import main
from bayesmembrane.app.tasks import measured, perform, sample
from bayesmembrane.calibration.run import load_run
from bayesmembrane.campaign.file import read_campaign
from bayesmembrane.campaign.plan import write_plan
from bayesmembrane.campaign.planning import plan
from bayesmembrane.campaign.record import read_now
from bayesmembrane.diagnosis.result import VERDICTS
from bayesmembrane.ground.jobs import silent
from tests.campaign.films import write_campaign, write_film

ROOT = Path(__file__).resolve().parents[2]

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Run:
    monkeypatch.chdir(tmp_path)

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["bayesmembrane", "campaign", *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            main()
        out, err = capsys.readouterr()
        return int(stop.value.code or 0), out, err

    return call


def draws(campaign: Path) -> dict[str, bytes]:
    """All draws of all runs, by film and hypothesis."""
    runs = [load_run(path.parent) for path in campaign.glob("films/*/*/run.toml")]
    return {
        f"{r.path.parent.name} {r.hypothesis.label()} {r.hypothesis.convexity}": r.draws().tobytes()
        for r in runs
        if r.path is not None
    }


def test_a_campaign_runs_goes_on_and_reports(run: Run, tmp_path: Path) -> None:
    file = write_campaign(tmp_path, analyses='wanted = ["sample"]\npages = true', films=("a",))
    write_film(tmp_path / "films", "bad").write_text("stretch,nominal_stress_MPa\n1.1,x\n")
    code, out, err = run("run", file, "--json", "--workers", 2, "--out", "two")
    answer = json.loads(out)
    assert code == 0, err
    assert (answer["tasks"]["done"], answer["tasks"]["refused"]) == (2, 1)
    assert (answer["ended"], answer["finished"]) == ("finished", True)
    assert any("bad.csv" in r["reason"] for r in answer["reasons"])
    rows = json.loads((tmp_path / "two" / "report" / "report.json").read_text())["rows"]
    assert len(rows) == 2
    for row in rows:
        assert row["ess"] >= 50
        assert row["parameters"]["c1"][1] < row["parameters"]["c1"][0] < row["parameters"]["c1"][2]
        assert (tmp_path / "two" / row["links"]["sample"]).is_file()

    # The same runs one after the other, and a hypothesis more: what was there before is equal to the last bit.
    more = file.read_text().replace('["reached", "none"]', '["box", "none", "reached"]')
    file.write_text(more.replace("pages = true", "pages = false"))
    code, out, _ = run("run", file, "--json", "--workers", 1, "--out", "one")
    assert (code, json.loads(out)["tasks"]["done"]) == (0, 3)
    serial, side_by_side = draws(tmp_path / "one"), draws(tmp_path / "two")
    assert len(side_by_side) == 2
    assert {name: serial[name] for name in side_by_side} == side_by_side

    # What is done is read, and not done again.
    before = {p: p.stat().st_mtime_ns for p in (tmp_path / "two" / "records").iterdir()}
    code, out, _ = run("resume", "two", "--json", "--workers", 1)
    assert (code, json.loads(out)["tasks"]["done"]) == (0, 2)
    assert {p: p.stat().st_mtime_ns for p in (tmp_path / "two" / "records").iterdir()} == before
    assert json.loads(run("status", "two", "--json")[1])["tasks"]["done"] == 2
    assert "sample" in run("status", "two")[1]
    code, out, _ = run("report", "two", "--out", "page", "--json")
    assert Path(json.loads(out)["report"]).read_text().startswith("<!DOCTYPE html>")


def test_a_dry_run_says_what_would_run_and_writes_nothing(run: Run, tmp_path: Path) -> None:
    file = write_campaign(tmp_path, analyses='wanted = ["sample", "valleys"]\npages = false')
    before = sorted(tmp_path.rglob("*"))
    code, out, err = run("run", file, "--dry-run", "--json", "--workers", 2)
    assert code == 0, err
    found = json.loads(out)
    assert found["tasks"] == {"sample": 4, "valleys": 4}
    assert (found["workers"], found["done"], found["refused"]) == (2, 0, [])
    assert 0.0 < found["core_seconds"]["valleys"] < found["core_seconds"]["sample"]
    rehearsed = [
        f"{analysis}: neo_hookean white {mode}, all, uniaxial of about 8 readings"
        for analysis in ("sample", "valleys")
        for mode in ("reached", "none")
    ]
    assert list(found["rehearsed"]) == rehearsed
    least, most = found["whole_core_seconds_range"]
    assert least < found["whole_core_seconds"] < most
    assert sum(found["core_seconds"].values()) + found["starting_core_seconds"] == pytest.approx(
        found["whole_core_seconds"]
    )
    assert sum(found["rehearsed"].values()) < found["whole_core_seconds"]
    assert found["seconds"] < found["whole_core_seconds"]
    assert sorted(tmp_path.rglob("*")) == before


def test_a_walk_that_is_stopped_before_anything_is_known_has_no_tau(tmp_path: Path) -> None:
    """A deadline may come right at the start of a walk, which is then stored as ever."""
    file = write_campaign(tmp_path, films=("a",))
    task = plan(read_campaign(file), file).tasks[0]
    work = Work(task.seed, tmp_path / "night", 50.0, stop=lambda: True)
    answer, values = sample(task, measured(task), work)
    assert answer.result.interrupted
    assert (values["tau"], values["ess"], values["converged"]) == (None, 0.0, False)


@pytest.mark.usefixtures("short_walks")
def test_a_loop_in_a_campaign_comes_to_its_end(tmp_path: Path) -> None:
    """Its runs lie apart from those of others, its answer is read back, and tables get its verdict."""
    file = write_campaign(tmp_path, films=("a",), analyses='wanted = ["loop"]\npages = true')
    campaign = tmp_path / "night"
    task = plan(read_campaign(file), file).tasks[0]
    found = perform(task, campaign, silent)
    assert found.values["verdict"] in VERDICTS
    assert found.values["rounds"] >= 1
    assert found.page is not None
    assert found.page.is_file()
    assert list((campaign / "films" / task.film / "loops" / task.key).glob("*/status.json"))
    before = {path: path.stat().st_mtime_ns for path in campaign.rglob("*.npz")}
    assert perform(task, campaign, silent).values == found.values
    assert {path: path.stat().st_mtime_ns for path in campaign.rglob("*.npz")} == before


def test_a_measurement_that_changed_since_is_refused(run: Run, tmp_path: Path) -> None:
    file = write_campaign(tmp_path, films=("a",))
    write_plan(tmp_path / "night", plan(read_campaign(file), file))
    write_film(tmp_path / "films", "a", 0.9)
    code, out, _ = run("resume", "night", "--json", "--workers", 1)
    answer = json.loads(out)
    assert (code, answer["tasks"]["refused"]) == (0, 2)
    assert "is not what it was" in answer["reasons"][0]["reason"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "none.toml"], ["none.toml"]),
        (["status", "none"], ["no campaign", "none"]),
        (["resume", "none"], ["no campaign", "none"]),
        (["report", "none"], ["no campaign", "none"]),
        (["status", "none", "--workers", "2"], ["--workers", "leave it out"]),
        (["report", "none", "--cluster", "tcp://x"], ["--cluster"]),
        (["resume", "none", "--seed", "3"], ["--seed"]),
        (["run", "none.toml", "--cluster", "tcp://x", "--workers", "2"], ["--cluster, --workers"]),
    ],
)
def test_a_wrong_setting_is_one_sentence_and_exit_1(run: Run, arguments: list[str], words: list[str]) -> None:
    code, out, err = run(*arguments)
    assert (code, out) == (1, "")
    assert len(err.strip().splitlines()) == 1
    for word in words:
        assert word in err


PROGRAM = """
import signal
from bayesmembrane.app.cli import main

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where a script began it in the background
    main()
"""


def begun(folder: Path, *arguments: object) -> subprocess.Popen[str]:
    """The command line as a process."""
    (folder / "program.py").write_text(PROGRAM)
    command = [sys.executable, "program.py", "campaign", *map(str, arguments)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(command, cwd=folder, env=environment, stderr=subprocess.PIPE, text=True)


def wait_for(what: Callable[[], bool]) -> None:
    latest = time.monotonic() + 300
    while not what():
        assert time.monotonic() < latest, "it never came"
        time.sleep(0.05)


def sampling(campaign: Path) -> bool:
    return any(now.get("ess") for now in read_now(campaign).values())


@pytest.mark.study
def test_a_campaign_that_is_killed_and_resumed_has_the_draws_of_one_that_was_not(run: Run, tmp_path: Path) -> None:
    file = write_campaign(tmp_path)
    client = begun(tmp_path, "run", file, "--out", "killed", "--workers", 2)
    wait_for(lambda: sampling(tmp_path / "killed"))
    client.kill()
    client.communicate(timeout=60)
    assert json.loads(run("status", "killed", "--json")[1])["tasks"]["done"] < 4
    assert json.loads(run("resume", "killed", "--json", "--workers", 1)[1])["tasks"]["done"] == 4
    assert json.loads(run("run", file, "--json", "--workers", 1, "--out", "calm")[1])["tasks"]["done"] == 4
    assert draws(tmp_path / "killed") == draws(tmp_path / "calm")


@pytest.mark.parametrize("number", [pytest.param(signal.SIGINT, marks=pytest.mark.study), signal.SIGTERM])
def test_a_signal_ends_with_130_and_the_command_that_goes_on(run: Run, tmp_path: Path, number: int) -> None:
    file = write_campaign(tmp_path, sampling="ess = 1e6\nmost_steps = 200000", films=("a",))
    client = begun(tmp_path, "run", file, "--out", "night", "--workers", 1)
    wait_for(lambda: sampling(tmp_path / "night"))
    client.send_signal(number)
    _, err = client.communicate(timeout=120)
    assert client.returncode == 130
    assert "bayesmembrane campaign resume night --workers 1" in err
    found = json.loads(run("status", "night", "--json")[1])
    assert found["tasks"]["running"] == 0
    assert found["tasks"]["preempted"] >= 1
    assert not found["active"]
