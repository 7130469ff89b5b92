"""Stored files that are damaged: each ends in a sentence, and none in a traceback or in other numbers.

python -m tests.studies.damage --times 500 --table docs/studies/damage.md [--only run campaign answers]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.app import analyses
from bayesmembrane.app.folders import RUN, lying
from bayesmembrane.calibration.run import Run
from bayesmembrane.calibration.sampling.segments import Segments
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.ground.errors import BayesmembraneError, StorageError
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.report.page import gathered
from tests.short_walks import shorten
from tests.studies.damage_more import File, answers, campaign
from tests.studies.kill import _question

Rng = np.random.Generator


def cut(content: bytes, rng: Rng) -> bytes:
    return content[: int(rng.integers(0, len(content)))]


def emptied(content: bytes, rng: Rng) -> bytes:
    return b""


def flipped(content: bytes, rng: Rng) -> bytes:
    at = int(rng.integers(len(content)))
    return content[:at] + bytes([content[at] ^ (1 << int(rng.integers(8)))]) + content[at + 1 :]


def zeroed(content: bytes, rng: Rng) -> bytes:
    at, size = int(rng.integers(len(content))), int(rng.integers(1, 600))
    return content[:at] + bytes(len(content[at : at + size])) + content[at + size :]


def noise(content: bytes, rng: Rng) -> bytes:
    at, size = int(rng.integers(len(content))), int(rng.integers(1, 60))
    return content[:at] + rng.bytes(len(content[at : at + size])) + content[at + size :]


def no_text(content: bytes, rng: Rng) -> bytes:
    at = int(rng.integers(len(content)))
    return content[:at] + b"\xff\xfe\xfa" + content[at:]


def edited(content: bytes, rng: Rng) -> bytes:
    """A digit is another one, as an editor's hand would have it."""
    places = [i for i, c in enumerate(content) if 48 <= c <= 57]
    if not places:
        return flipped(content, rng)
    at = int(rng.choice(places))
    return content[:at] + bytes([48 + (content[at] - 48 + int(rng.integers(1, 10))) % 10]) + content[at + 1 :]


def without_a_line(content: bytes, rng: Rng) -> bytes:
    lines = content.splitlines(keepends=True)
    del lines[int(rng.integers(len(lines)))]
    return b"".join(lines)


def without_its_checksum(content: bytes, rng: Rng) -> bytes:
    """What an earlier version might have written, and somebody then edited."""
    lines = [line for line in content.splitlines(keepends=True) if b"sha256" not in line]
    rest = b"".join(lines)
    return edited(rest, rng) if rest else b""


def lengthened(content: bytes, rng: Rng) -> bytes:
    return content + rng.bytes(int(rng.integers(1, 100)))


DAMAGES: tuple[Callable[[bytes, Rng], bytes], ...] = (
    cut, emptied, flipped, zeroed, noise, no_text, edited, without_a_line, without_its_checksum, lengthened,
)  # fmt: skip

GOOD = ("told", "as it was", "passed over", "as it stands")
PARTS = ("run", "campaign", "answers")


def stored(place: Path) -> Path:
    """A folder with a run, its predictions and a fit."""
    shorten()
    measurement, claim = _question("band neo_hookean white", 0)
    work = analyses.Work(out=place, ess=Settings().ess)
    analyses.sample(measurement, claim, work, name="run")
    analyses.fit(measurement, hypothesis("neo_hookean"), work)
    return place


def read(folder: Path) -> Any:
    """All that a report and `load` read there, as plain bytes of what matters; what takes longest comes last."""
    kept: list[Any] = []
    here = sorted(lying([folder]), key=lambda each: each.kind == RUN)
    walks = [Segments(each.folder).read() for each in here if each.kind == RUN]
    kept += [walk and walk.x.tobytes() for walk in walks]
    for each in here:
        result = each.read()
        if isinstance(result, Run):
            kept += [result.settings, result.status, result.draws().tobytes(), result.curves().tobytes()]
        else:
            kept.append(result.summary())
    found = gathered([folder])
    if found.left_out:
        raise StorageError(found.left_out[0])
    return kept, len(found.results)


def damaged(folder: Path, times: int, seed: int) -> dict[str, Counter[str]]:
    """What became of every file when it was damaged so many times: "told", "as it was", or what went wrong."""
    rng, found = np.random.default_rng(seed), dict[str, Counter[str]]()
    whole = read(folder)
    names = ("lock", "curves.sqlite")
    for path in sorted(p for p in folder.rglob("*") if p.is_file() and p.name not in names):
        content, count = path.read_bytes(), Counter[str]()
        for number in range(times):
            damage = DAMAGES[number % len(DAMAGES)]
            path.write_bytes(damage(content, rng))
            try:
                count["as it was" if read(folder) == whole else f"other numbers ({damage.__name__})"] += 1
            except BayesmembraneError:
                count["told"] += 1
            except Exception as error:
                count[f"{type(error).__name__} ({damage.__name__}): {str(error)[:60]}"] += 1
        path.write_bytes(content)
        name = path.name if path.suffix != ".seg" else f"segments/{path.name}"
        found[name] = count
        print(f"{name}: {dict(count)}", file=sys.stderr, flush=True)
    return found


def damaged_more(files: Sequence[File], times: int, seed: int) -> dict[str, Counter[str]]:
    """The same for single files; "passed over": all is as if this one were not there, and it is made again."""
    rng, found = np.random.default_rng(seed), dict[str, Counter[str]]()
    for file in files:
        content, whole, count = file.path.read_bytes(), file.read(), Counter[str]()
        file.path.unlink()
        try:
            without = file.read()
        except BayesmembraneError:
            without = None
        for number in range(times):
            damage = DAMAGES[number % len(DAMAGES)]
            file.path.write_bytes(damage(content, rng))
            try:
                count[_became(file, file.read(), whole, without, damage.__name__)] += 1
            except BayesmembraneError:
                count["told"] += 1
            except Exception as error:
                count[f"{type(error).__name__} ({damage.__name__}): {str(error)[:60]}"] += 1
        file.path.write_bytes(content)
        found[file.name] = count
        print(f"{file.name}: {dict(count)}", file=sys.stderr, flush=True)
    return found


def _became(file: File, now: Any, whole: Any, without: Any, damage: str) -> str:
    if now == whole:
        return "as it was"
    if now == without:
        return "passed over"
    return f"other numbers ({damage})" if file.sealed else "as it stands"


def row(name: str, count: Counter[str]) -> str:
    good = [count[g] for g in GOOD]
    return "| " + " | ".join(map(str, [name, count.total(), *good, count.total() - sum(good)])) + " |"


def merged(found: dict[str, Counter[str]], page: str) -> dict[str, str]:
    """Lines of the table by file: as they stand on the ``page``, with those that were ``found`` in their place."""
    lines = [line for line in page.splitlines() if line.startswith("| ")]
    stand = {line.split(" | ")[0].removeprefix("| "): line for line in lines[1:]}
    return stand | {name: row(name, count) for name, count in found.items()}


def table(lines: dict[str, str], times: int, seed: int) -> str:
    rows = "\n".join(lines.values())
    return f"""# Stored files that are damaged

`make study-damage` (`python -m tests.studies.damage --times {times} --seed {seed}`): each file of a folder with a run,
its predictions and a fit is damaged in ten ways, {times} times in all (cut, emptied, a bit flipped, bytes set to zero,
at random or to no text, a digit edited, a line or the checksum removed, bytes added), and all that `load` and `report`
read is read. So are the answers of each other verb, the files of a campaign, whose `status` and page are made, and what
a user wrote.

"As it was": what was damaged says nothing, as the word after a checksum, or what was lost was made again from other
files. "Passed over": as if the file were not there; its task is done again. "As it stands": nothing tells that
it was damaged, for a user wrote it, or it is the passing note of a worker; a run compares the hash of its data.
Valleys, diagnosis and loop are those of a short neo-Hookean curve.

| file | times | a sentence | as it was | passed over | as it stands | a traceback or other numbers |
|---|---|---|---|---|---|---|
{rows}
"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--times", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS, help="other lines of the table stay")
    given = parser.parse_args()
    found: dict[str, Counter[str]] = {}
    with tempfile.TemporaryDirectory() as place:
        root = Path(place)
        for name, made in (("campaign", campaign), ("answers", answers)):
            if name in given.only:
                found |= damaged_more(made(root / name), given.times, given.seed)
        if "run" in given.only:  # last, for it makes all walks short
            found = damaged(stored(root / "run"), given.times, given.seed) | found
    before = given.table.read_text(encoding="utf-8") if given.table is not None and given.table.is_file() else ""
    page = table(merged(found, before), given.times, given.seed)
    if given.table is not None:
        given.table.write_text(page, encoding="utf-8")
    print(page)
    wrong = {name: {k: n for k, n in c.items() if k not in GOOD} for name, c in found.items()}
    wrong = {name: c for name, c in wrong.items() if c}
    print(wrong or "nothing went wrong")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
