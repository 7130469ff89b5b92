"""A comparison stopped at the terminal: what is finished stays, and the command that it prints goes on from there."""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

from bayesmembrane.data.shipped import shipped

LONGEST = 300.0  # s, until the first hypothesis is stored
CURVE = [str(shipped(f"elastosil_50um_op1.{end}")) for end in ("csv", "toml")]


def started(out: Path) -> "subprocess.Popen[str]":
    """`compare` as a shell starts it, in a process group of its own."""
    words = ["compare", CURVE[0], "--specimen", CURVE[1], "--materials", "neo_hookean,yeoh"]
    words += ["--max-deflection-mm", "25", "--ess", "200", "--out", str(out), "--json"]
    # A job that a script puts into the background ignores interruptions; this one must not.
    code = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
    code += "from bayesmembrane.app.cli import main; sys.exit(main())"
    return subprocess.Popen(
        [sys.executable, "-c", code, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def test_what_is_finished_is_kept_and_the_printed_command_goes_on(tmp_path: Path) -> None:
    first = started(tmp_path)
    give_up = time.monotonic() + LONGEST
    while not list(tmp_path.glob("*/comparison/bridge.json")) and time.monotonic() < give_up and first.poll() is None:
        time.sleep(0.05)
    os.killpg(first.pid, signal.SIGINT)
    _, err = first.communicate(timeout=LONGEST)
    assert first.returncode == 130, err
    assert "Traceback" not in err
    command = err.split("The same command resumes it: ")[1].split("\n")[0]
    assert shlex.split(command)[:2] == ["bayesmembrane", "compare"]
    kept = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*/comparison/bridge.json")}
    assert kept
    again = started(tmp_path)
    out, err = again.communicate(timeout=LONGEST)
    assert again.returncode == 0, err
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    assert [row["hypothesis"] for row in json.loads(out)["table"]] == ["neo_hookean", "yeoh"]
