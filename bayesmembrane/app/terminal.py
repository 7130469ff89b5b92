"""What people see in the terminal: tables, sentences and progress on stderr, answers on stdout."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TaskID, TextColumn, TimeElapsedColumn
from rich.table import Table

from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.plain import plain

log = Console(stderr=True, highlight=False, soft_wrap=True)
out = Console(highlight=False, soft_wrap=True)


def numbers(text: str, option: str) -> list[float]:
    """Comma-separated finite numbers; raises `SettingsError` naming the option and the entry."""
    values = []
    for entry in text.split(","):
        try:
            value = float(entry)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise SettingsError(
                f'"{entry.strip()}" is not a finite number',
                where=option,
                remedy="write numbers with decimal points, separated by commas: 1,10,35.1",
            )
        values.append(value)
    return values


def answer(document: dict[str, Any], as_json: bool, show: Callable[[], None]) -> None:
    """Print the JSON document, with nan and infinity as null, or the text for people."""
    if as_json:
        sys.stdout.write(json.dumps(plain(document), allow_nan=False) + "\n")
    else:
        show()


def table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table on stdout; the first column to the left, numbers to the right."""
    grid = Table(title=title, title_justify="left")
    for i, name in enumerate(header):
        grid.add_column(name, justify="left" if i == 0 else "right", overflow="fold")
    for row in rows:
        grid.add_row(*row)
    out.print(grid)


@contextmanager
def lines() -> Iterator[Callable[[str, str], None]]:
    """A line on stderr for each label, with what is being done for it and for how long."""
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TextColumn("{task.fields[text]}"))
    with Progress(*columns, TimeElapsedColumn(), console=log) as shown:
        tasks: dict[str, TaskID] = {}

        def tell(label: str, text: str) -> None:
            if label not in tasks:
                tasks[label] = shown.add_task(label, total=None, text=text)
            shown.update(tasks[label], text=text)

        yield tell
