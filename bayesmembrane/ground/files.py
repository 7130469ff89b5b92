"""The one way to write a file: whole, synced and renamed, so that nobody ever reads half of it."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bayesmembrane.ground.errors import StorageError

REMEDY = "free some space, make the folder writable, or name another one"


def write_whole(path: Path, writer: Callable[[Path], Any], what: str = "the file") -> Path:
    """Let ``writer`` fill a temporary file beside ``path``; sync it, rename it over ``path``, sync the folder.

    A reader sees the old file or the new one, also after a power cut; a ``writer`` that raises leaves the old one.
    Missing folders are made. Returns ``path``.

    Raises `StorageError` that says ``what`` cannot be written, where and why; whatever else ``writer`` raises passes.
    """
    path = Path(path)
    try:
        make_folder(path.parent)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        os.close(handle)
        part = Path(name)
        try:
            writer(part)
            part.chmod(0o644)
            _sync(part)
            part.replace(path)
            _sync(path.parent)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise unwritable(what, path, error) from None
    return path


def write_text(path: Path, text: str, what: str = "the file") -> Path:
    """`write_whole` of a text in UTF-8, its lines ending alike on every machine."""
    return write_whole(path, lambda part: part.write_text(text, encoding="utf-8", newline="\n"), what)


def make_folder(path: Path) -> Path:
    """Make a folder and those above it, each synced into the one that holds it; returns it. Raises OSError.

    A new folder whose entry is not on the disk takes all that is synced inside it along when the power goes.
    """
    path = Path(path)
    if not path.is_dir():
        make_folder(path.parent)
        path.mkdir(exist_ok=True)
        _sync(path.parent)
    return path


def ensure_writable(folder: Path, what: str = "the answer") -> None:
    """Make the folder, and see that something can be written there, before work is done for it.

    Raises `StorageError` that says ``what`` cannot be written, where and why.
    """
    try:
        handle, name = tempfile.mkstemp(dir=make_folder(folder), prefix=".writable.")
        os.close(handle)
        Path(name).unlink()
    except OSError as error:
        raise unwritable(what, folder, error) from None


def check_folder(folder: Path) -> None:
    """Raise `StorageError` unless something can be read in the folder: it is not there, or a file."""
    if folder.is_dir():
        return
    if folder.exists():
        raise StorageError("this is a file and no folder", str(folder), "name the folder that holds it")
    raise StorageError("there is no such folder", str(folder), "name one that holds stored answers, as chains/ does")


def remove_parts(folder: Path, name: str) -> None:
    """Remove what a process that was killed left of files called ``name`` (a pattern) while it wrote them.

    Only for who knows that nobody else is writing there.
    """
    for part in Path(folder).glob(f".{name}.????????"):
        part.unlink(missing_ok=True)


def unwritable(what: str, path: Path, error: OSError) -> StorageError:
    """The error that says ``what`` cannot be written, where, why, and what to do."""
    return StorageError(f"{what} cannot be written ({error.strerror or error})", str(path), REMEDY)


def _sync(path: Path) -> None:
    """Wait until a file, or the entries of a folder, are on the disk; file systems that cannot promise that pass."""
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno in _FULL:
            raise
    finally:
        os.close(handle)


_FULL = {errno.EIO, errno.ENOSPC, errno.EDQUOT}  # then what was written is not there
