"""A comparison stopped at the terminal: what is finished stays, and the command that it prints goes on from there."""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.app.cli import main
from bayesmembrane.comparison import compare
from tests.short_walks import shorten

ROOT = Path(__file__).resolve().parents[2]
LONGEST = 300.0  # s, for what takes a few; compiled code may have to be made first
# Two that are judged in seconds: a strip needs no solver.
CLAIMS = ["neo_hookean", "mooney_rivlin"]


def strip(folder: Path) -> list[str]:
    """Twelve points of a neo-Hookean strip: a curve and its specimen."""
    stretch = np.linspace(1.1, 2.5, 12)
    stress = 0.3 * (stretch - stretch**-2) + 2e-3 * np.random.default_rng(31).standard_normal(12)
    rows = "".join(f"{a},{s}\n" for a, s in zip(stretch, stress, strict=True))
    (folder / "strip.csv").write_text("stretch,nominal_stress_MPa\n" + rows)
    (folder / "strip.toml").write_text('[specimen]\nthickness_um = 500\n[rig]\nkind = "uniaxial"\n')
    return [str(folder / "strip.csv"), "--specimen", str(folder / "strip.toml")]


@contextmanager
def started(out: Path) -> Iterator["subprocess.Popen[str]"]:
    """`compare` as a shell starts it, in a process group of its own; none of the group is left behind."""
    words = ["compare", *strip(out), "--materials", ",".join(CLAIMS), "--out", str(out), "--json"]
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.comparison.short_compare", *words],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):  # nobody is left
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def test_what_is_finished_is_kept_and_the_printed_command_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    give_up = time.monotonic() + LONGEST
    with started(tmp_path) as first:
        # What follows on the bridge of a hypothesis takes longer than this looks away.
        while not list(tmp_path.glob("*/comparison/bridge.json")) and first.poll() is None:
            assert time.monotonic() < give_up, "no hypothesis was stored"
            time.sleep(0.05)
        os.killpg(first.pid, signal.SIGINT)
        _, err = first.communicate(timeout=LONGEST)
    assert first.returncode == 130, err
    assert "Traceback" not in err
    command = shlex.split(err.split("The same command resumes it: ")[1].split("\n")[0])
    assert command[:2] == ["bayesmembrane", "compare"]
    kept = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*/comparison/bridge.json")}
    assert kept
    # In this process, which has loaded what three fresh ones would load again.
    shorten(monkeypatch.setattr)
    monkeypatch.setattr(compare, "cores", lambda: 1)
    monkeypatch.setattr(sys, "argv", command)
    with suppress(SystemExit):
        main()
    found = json.loads(capsys.readouterr().out)
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    assert [row["hypothesis"] for row in found["table"]] == CLAIMS
    assert all(row["log_evidence"] for row in found["table"])
