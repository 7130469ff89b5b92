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

from bayesmembrane.data.shipped import shipped

ROOT = Path(__file__).resolve().parents[2]
LONGEST = 300.0  # s, for what takes a few; compiled code may have to be made first
CURVE = [str(shipped(f"elastosil_50um_op1.{end}")) for end in ("csv", "toml")]
# Two that are sampled in a moment: of one energy, so that little is compiled, and far from where it breaks.
CLAIMS = ["neo_hookean", "neo_hookean+force_offset"]


@contextmanager
def started(out: Path) -> Iterator["subprocess.Popen[str]"]:
    """`compare` as a shell starts it, in a process group of its own; none of the group is left behind."""
    words = ["compare", CURVE[0], "--specimen", CURVE[1], "--materials", ",".join(CLAIMS)]
    words += ["--max-deflection-mm", "25", "--out", str(out), "--json"]
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


def test_what_is_finished_is_kept_and_the_printed_command_goes_on(tmp_path: Path) -> None:
    give_up = time.monotonic() + LONGEST
    with started(tmp_path) as first:
        # What follows on the bridge of a hypothesis takes longer than the sampling before it.
        while not list(tmp_path.glob("*/comparison/bridge.json")) and first.poll() is None:
            assert time.monotonic() < give_up, "no hypothesis was stored"
            time.sleep(0.05)
        os.killpg(first.pid, signal.SIGINT)
        _, err = first.communicate(timeout=LONGEST)
    assert first.returncode == 130, err
    assert "Traceback" not in err
    command = err.split("The same command resumes it: ")[1].split("\n")[0]
    assert shlex.split(command)[:2] == ["bayesmembrane", "compare"]
    kept = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*/comparison/bridge.json")}
    assert kept
    with started(tmp_path) as again:
        out, err = again.communicate(timeout=LONGEST)
    assert again.returncode == 0, err
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    assert len(json.loads(out)["table"]) == len(CLAIMS)
