"""Results of a study, one line of JSON a case: written as soon as it is done, so that an interrupted study goes on."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

Row = dict[str, Any]
Item = TypeVar("Item")


def stored(path: Path) -> dict[str, Row]:
    """Results by key; a line that an interruption cut short is left out."""
    out = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            continue
        out[row["key"]] = row
    return out


def append(rows: Iterator[Row], path: Path, line_of: Callable[[Row], str]) -> None:
    """Write each row behind those that are there, and print its line."""
    path.parent.mkdir(parents=True, exist_ok=True)
    cut = path.exists() and path.read_bytes()[-1:] not in (b"", b"\n")
    with path.open("a", encoding="utf-8") as file:
        file.write("\n" if cut else "")
        for row in rows:
            file.write(json.dumps(row) + "\n")
            file.flush()
            print(line_of(row), flush=True)


def until(
    seconds: float, todo: Sequence[Item], work: Callable[[Item], Row], jobs: int, warmed: Callable[[], None]
) -> Iterator[Row]:
    """The row of each item; none is begun once ``seconds`` have passed. ``warmed`` is called first in every process."""
    if not todo:
        return
    if jobs == 1:
        warmed()
        end = time.monotonic() + seconds
        for item in todo:
            if time.monotonic() > end:
                return
            yield work(item)
        return
    with ProcessPoolExecutor(jobs, initializer=warmed) as pool:
        # A few at a time: what has begun is finished, and nothing more is begun after the end.
        rest, end = iter(todo), time.monotonic() + seconds
        while time.monotonic() < end and (some := list(islice(rest, 8 * jobs))):
            yield from pool.map(work, some)
