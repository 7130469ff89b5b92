"""A campaign of 60 runs that is killed three times, resumed and reported: every run ends as if nothing had happened.

python -m tests.studies.kill_campaign --kills 3 --table docs/studies/kill_campaign.md

All is done as users do it, by processes of the command line. The first kill takes the client alone, whose workers must
end with it; the next takes client and workers at once, as a power cut would; and so on in turn.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration.run import load_run
from bayesmembrane.campaign.record import read_now, read_records
from tests.campaign.films import write_campaign
from tests.studies.kill import same

ROOT = Path(__file__).resolve().parents[2]
FILMS = ("a", "b", "c", "d", "e")
HYPOTHESES = {
    "materials": ["neo_hookean", "mooney_rivlin"],
    "noise": ["white", "ar1"],
    "convexity": ["reached", "box", "none"],
}
SAMPLING = "ess = 50\nwalkers = 16\nchunk = 40\nmost_steps = 100"
LONGEST = 3600.0  # s, for what takes some minutes on a machine that does nothing else


@dataclass(frozen=True)
class Kill:
    """Who was killed, and how many tasks were done and ran then."""

    who: str
    done: int
    running: int


@dataclass(frozen=True)
class Night:
    """What became of a campaign.

    runs, done : planned, and done at the end
    kills : one after the other
    lost : records that were there at one kill and gone, or others, at the next or at the end
    different : runs with another bit than those of the calm campaign, in walk, draws, status or record
    rows : of its page
    """

    runs: int
    done: int
    kills: tuple[Kill, ...]
    lost: int
    different: int
    rows: int


def command(*words: object) -> list[str]:
    return [sys.executable, "-m", "bayesmembrane", "campaign", *map(str, words)]


def called(*words: object) -> dict[str, Any]:
    """The JSON answer of a command that comes to its end."""
    full = [*command(*words), "--json"]
    done = subprocess.run(full, cwd=ROOT, capture_output=True, text=True, timeout=LONGEST, check=False)
    if done.returncode:
        raise SystemExit(f"campaign {words[0]} ended with {done.returncode}: {done.stderr}")
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


@contextmanager
def going(*words: object) -> Iterator[subprocess.Popen[bytes]]:
    """A command in a process group of its own, of which nobody is left behind."""
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(command(*words), cwd=ROOT, stdout=quiet, stderr=quiet, start_new_session=True)
    try:
        yield process
    finally:
        _end_group(process)


def _end_group(process: subprocess.Popen[bytes]) -> None:
    with suppress(ProcessLookupError):  # nobody is left
        os.killpg(process.pid, signal.SIGKILL)
    process.wait(timeout=60)


def killed(campaign: Path, words: tuple[object, ...], after: int, pause: float, alone: bool) -> Kill:
    """Start, wait until ``after`` tasks are done and something runs, and ``pause`` s more; kill."""
    with going(*words) as process:
        latest = time.monotonic() + LONGEST
        while not (len(read_records(campaign)) >= after and read_now(campaign)):
            if process.poll() is not None or time.monotonic() > latest:
                raise SystemExit(f"the campaign came to its end before {after} tasks were done")
            time.sleep(0.01)
        time.sleep(pause)  # the moment is to be any
        running = len(read_now(campaign))
        if alone:
            process.kill()
            process.wait(timeout=60)
            while read_now(campaign):  # its workers end with it
                time.sleep(0.01)
        else:
            _end_group(process)
    done = called("status", campaign)["tasks"]["done"]
    return Kill("client" if alone else "client and workers", done, running)


def _records(campaign: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted((campaign / "records").glob("*.json"))}


def _different(shot: Path, calm: Path) -> int:
    """Runs of the calm campaign that the other one lacks, or has with another bit."""
    found, wanted = read_records(shot), read_records(calm)
    count = 0
    for key, record in wanted.items():
        other = found.get(key)
        alike = other is not None and dict(other.found) == dict(record.found) and other.folder == record.folder
        count += not (alike and same(load_run(shot / record.folder), load_run(calm / record.folder)))
    return count


def study(place: Path, kills: int, films: int, seed: int) -> Night:
    """One campaign that is killed so often, and one that is not."""
    lines = "\n".join(f"{name} = {json.dumps(values)}" for name, values in HYPOTHESES.items())
    file = write_campaign(place, films=FILMS[:films], hypotheses=lines, sampling=SAMPLING)
    shot, calm, rng = place / "shot", place / "calm", np.random.default_rng(seed)
    words: tuple[object, ...] = ("run", file, "--out", shot, "--workers", 2)
    total = films * int(np.prod([len(values) for values in HYPOTHESES.values()]))
    told, seen = [], [_records(shot)]
    for number in range(kills):
        after = (number + 1) * total // (kills + 2)
        told.append(killed(shot, words, after, float(rng.uniform(0.0, 2.0)), number % 2 == 0))
        seen.append(_records(shot))
        words = ("resume", shot, "--workers", 2)
    ended = called(*words)
    seen.append(_records(shot))
    page = Path(called("report", shot)["report"])
    called("run", file, "--out", calm, "--workers", 1)
    return Night(
        runs=total,
        done=ended["tasks"]["done"],
        kills=tuple(told),
        lost=sum(now.get(name) != was for then, now in pairwise(seen) for name, was in then.items()),
        different=_different(shot, calm),
        rows=len(json.loads(page.with_name("report.json").read_text())["rows"]),
    )


def table(found: Night, words: str) -> str:
    """What was found, as a page."""
    lines = "\n".join(f"| {i} | {kill.who} | {kill.done} | {kill.running} |" for i, kill in enumerate(found.kills, 1))
    return f"""# A campaign that is killed

`make study-kill` (`python -m tests.studies.kill_campaign {words}`):
`campaign run` of {found.runs} tiny runs (strips, two materials, two noise models, three convexity modes) on two
workers, killed by SIGKILL, gone on with by `campaign resume` after each kill, then reported. Beside it the same
campaign, undisturbed and on one worker.

| kill | of whom | runs done then | running then |
|---|---|---|---|
{lines}

| | |
|---|---|
| runs planned | {found.runs} |
| done at the end | {found.done} |
| records lost or written again | {found.lost} |
| rows of the page | {found.rows} |
| runs that differ in a bit from the undisturbed ones (walk, draws, status, record) | {found.different} |
"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--kills", type=int, default=3)
    parser.add_argument("--films", type=int, default=5, help=f"{60 // 5} runs each")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="nights-") as place:
        found = study(Path(place).resolve(), given.kills, given.films, given.seed)
    page = table(found, f"--kills {given.kills} --films {given.films} --seed {given.seed}")
    if given.table is not None:
        given.table.write_text(page, encoding="utf-8")
    print(page)
    return int(bool(found.different or found.lost or found.done < found.runs))


if __name__ == "__main__":
    sys.exit(main())
