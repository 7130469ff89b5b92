"""Finished pieces of a long computation, kept until its answer is stored: who is killed goes on after the last one.

Each is a stored value of its own (`ground.stored`), with the key of the question that it belongs to. What is read back
is what was made, to the last bit, so that the answer is that of a computation that nobody disturbed.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TypeVar

from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.stored import answer, read, store

FOLDER = "pieces"

Piece = TypeVar("Piece")

_here: ContextVar[tuple[Path, str, str] | None] = ContextVar("pieces", default=None)  # folder, key, prefix of names


@contextmanager
def keeping(answer_folder: Path | None, key: str) -> Iterator[None]:
    """Inside, `piece` keeps what is made in ``answer_folder/pieces``; None keeps nothing.

    ``key`` says what is asked, with the data, the code and the seed.
    """
    token = _here.set(None if answer_folder is None else (answer_folder / FOLDER, key, ""))
    try:
        yield
    finally:
        _here.reset(token)


@contextmanager
def within(name: str) -> Iterator[None]:
    """Inside, names of pieces begin with ``name``: for what is done several times in one question."""
    found = _here.get()
    token = _here.set(None if found is None else (found[0], found[1], f"{found[2]}{name}-"))
    try:
        yield
    finally:
        _here.reset(token)


def piece(name: str, make: Callable[[], Piece]) -> Piece:
    """What ``make`` returns, or what it returned when the same was asked before; kept if somebody keeps pieces.

    Names are those of one question: the same name must mean the same call. Raises `StorageError` if it cannot be
    written.
    """
    found = _here.get()
    if found is None:
        return make()
    folder, key, prefix = found
    with keeping(None, ""):  # a piece is kept whole, and nothing inside it takes its names
        return stored_once(folder, f"{prefix}{name}", key, make)


def stored_once(folder: Path, name: str, key: str, make: Callable[[], Piece]) -> Piece:
    """What lies in ``folder`` under ``name`` if it was made with the same ``key``; else what ``make`` returns, stored.

    Raises `StorageError` if it cannot be written. What cannot be read is made again.
    """
    digest = hashlib.sha256(key.encode()).hexdigest()
    try:
        if (answer(folder, name) or {}).get("key") == digest:
            found: Piece = read(folder, name)
            return found
    except StorageError:
        pass  # damaged: made again below
    made = make()
    store(folder, name, made, {"key": digest})
    return made


def drop(answer_folder: Path) -> None:
    """Remove the pieces of an answer that is there."""
    shutil.rmtree(answer_folder / FOLDER, ignore_errors=True)
