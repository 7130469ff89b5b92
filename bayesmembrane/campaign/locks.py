"""Locks that a dead owner does not keep: the system lets go of them when the process ends, however it ends."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bayesmembrane.ground.errors import StorageError

LOOK = 0.5  # s between two tries


@contextmanager
def held(path: Path, wait: float = 0.0) -> Iterator[bool]:
    """Whether the lock at ``path`` is ours, which it stays inside; another owner is waited for as long as ``wait`` s.

    The file is there while somebody has the lock, or died with it. Raises `StorageError` where it cannot be made.
    """
    handle = _taken(path, time.monotonic() + wait)
    try:
        yield handle is not None
    finally:
        if handle is not None:
            path.unlink(missing_ok=True)
            os.close(handle)


def _taken(path: Path, latest: float) -> int | None:
    """An open file that we have locked; None if another owner has it at the time ``latest``."""
    while True:
        handle = _opened(path)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(handle)
            if time.monotonic() >= latest:
                return None
            time.sleep(LOOK)
            continue
        if _is_at(path, handle):
            return handle
        os.close(handle)  # its owner has just removed it: whoever comes next makes another one


def _opened(path: Path) -> int:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise StorageError(f"the lock cannot be made ({error.strerror})", str(path), "make it writable") from None


def _is_at(path: Path, handle: int) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except FileNotFoundError:
        return False


def is_held(path: Path) -> bool:
    """Whether a living process has the lock; looks only, and makes no file."""
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
        return False
    except BlockingIOError:
        return True
    finally:
        os.close(handle)
