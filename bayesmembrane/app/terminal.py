"""What people see in the terminal: tables, sentences and progress on stderr, answers on stdout.

rich is imported where something is shown, for ``--json`` and ``--help`` do without its tables and bars.
"""

from __future__ import annotations

import json
import math
import os
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from bayesmembrane.ground.errors import SettingsError, StorageError

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

    from bayesmembrane.calibration.sampling.walk import Progress

INTERRUPTED = 130


@cache
def _console(stderr: bool) -> Console:
    from rich.console import Console

    return Console(stderr=stderr, highlight=False, soft_wrap=True)


def ready() -> None:
    """Let signs that the terminal cannot show, and bytes of file names that are no text, be written in other words."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


@contextmanager
def _written() -> Iterator[None]:
    """Turn a stdout that cannot be written to into a sentence; raises `StorageError`."""
    try:
        if sys.stdout is None:
            raise OSError("it is closed")
        yield
        sys.stdout.flush()
    except OSError as error:
        _forget_stdout()
        raise StorageError(
            f"the answer cannot be printed ({error.strerror or error})", "stdout", "what was stored is stored"
        ) from None


def _forget_stdout() -> None:
    """Have nothing tried again when the program ends."""
    if sys.stdout is not None:
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def say(text: str) -> None:
    """A sentence on stdout, as it is."""
    with _written():
        _console(False).print(text, markup=False)


def note(text: str) -> None:
    """A sentence on stderr, as it is."""
    _console(True).print(text, markup=False)


def say_few(readings: int, done: str) -> None:
    """On stderr, before the work: that not all ``readings`` will be used for what is ``done``."""
    from bayesmembrane.data.thinning import EVENLY, MOST

    if readings > MOST:
        note(f"{done} by {MOST} of the {readings} readings, {EVENLY}.")


def answer(document: dict[str, Any], as_json: bool, show: Callable[[], None]) -> None:
    """Print the JSON document, with nan and infinity as null, or the text for people."""
    from bayesmembrane.ground.plain import plain

    if as_json:
        with _written():
            sys.stdout.write(json.dumps(plain(document), allow_nan=False) + "\n")
    else:
        show()


def table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table on stdout; the first column to the left, numbers to the right."""
    from rich.table import Table
    from rich.text import Text

    # As texts: brackets in a name are no markup.
    grid = Table(title=Text(title, style="italic"), title_justify="left")
    for i, name in enumerate(header):
        grid.add_column(Text(name), justify="left" if i == 0 else "right", overflow="fold")
    for row in rows:
        grid.add_row(*map(Text, row))
    with _written():
        _console(False).print(grid)


# ---- what is typed ---------------------------------------------------------------------------------------------------


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


def command() -> str:
    """The command that was typed."""
    return shlex.join(["bayesmembrane", *sys.argv[1:]])


# ---- while something is computed -------------------------------------------------------------------------------------


@contextmanager
def status(text: str) -> Iterator[Callable[[str], None]]:
    """A line on stderr that says what is being done; give it another text by calling what this yields."""
    from rich.text import Text

    with _console(True).status(Text(text)) as shown:
        yield lambda now: shown.update(Text(now))


@contextmanager
def lines() -> Iterator[Callable[[str, str], None]]:
    """A line on stderr for each label, with what is being done for it and for how long."""
    from rich.progress import Progress, SpinnerColumn, TaskID, TextColumn, TimeElapsedColumn

    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        TextColumn("{task.fields[text]}", markup=False),
    )
    with Progress(*columns, TimeElapsedColumn(), console=_console(True)) as shown:
        tasks: dict[str, TaskID] = {}

        def tell(label: str, text: str) -> None:
            if label not in tasks:
                tasks[label] = shown.add_task(label, total=None, text=text)
            shown.update(tasks[label], text=text)

        yield tell


@contextmanager
def bars() -> Iterator[Callable[[str, Progress | str], None]]:
    """A bar on stderr for each label: how far its sampling is, or a text; "" completes it."""
    from rich.progress import BarColumn, TaskID, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bars

    columns = (
        TextColumn("{task.description:<22}", markup=False),
        BarColumn(),
        TextColumn("{task.fields[text]}", markup=False),
    )
    with Bars(*columns, TimeElapsedColumn(), console=_console(True)) as shown:
        tasks: dict[str, TaskID] = {}

        def tell(label: str, now: Progress | str) -> None:
            if label not in tasks:
                tasks[label] = shown.add_task(label, total=1.0, text="")
            if now == "":
                shown.update(tasks[label], completed=1.0, text="done")
            elif isinstance(now, str):
                shown.update(tasks[label], text=now)
            else:
                shown.update(tasks[label], completed=share(now), text=in_words(now))

        yield tell


@contextmanager
def live() -> Iterator[Callable[[RenderableType], None]]:
    """Something on stderr that changes in place: call what this yields with what is to be seen now."""
    from rich.live import Live

    with Live(console=_console(True), auto_refresh=False, transient=True) as shown:
        yield lambda what: shown.update(what, refresh=True)


def show(what: RenderableType) -> None:
    """Something on stdout."""
    _console(False).print(what)


def share(progress: Progress) -> float:
    """How much of a run is done, from 0 to 1: the worse of ESS and time."""
    left = progress.seconds_left
    if progress.steps_per_second > 0 and math.isfinite(left):
        spent = progress.steps / progress.steps_per_second
        return float(spent / (spent + left)) if spent + left > 0 else 1.0
    return float(min(progress.ess / progress.wanted, 1.0))


def in_words(progress: Progress) -> str:
    """ESS and time left in words."""
    left = progress.seconds_left
    rest = f", {left:.0f} s left" if math.isfinite(left) else ""
    return f"ESS {progress.ess:.0f} of {progress.wanted:.0f}, R-hat {progress.r_hat:.3f}{rest}"


@contextmanager
def resumable(folder: Path) -> Iterator[None]:
    """Turn an interrupt into the sentence that says what is stored and how to go on, and exit status 130."""
    try:
        yield
    except KeyboardInterrupt:
        note(f"Interrupted; what is finished is stored in {folder}. The same command resumes it: {command()}")
        raise typer.Exit(INTERRUPTED) from None
