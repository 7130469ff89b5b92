"""One process at a time: a lock that the operating system takes from an owner who is dead."""

from __future__ import annotations

import errno
import os
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.files import make_folder, unwritable

LOOK = 0.5  # s between two tries
# Windows has no flock; there nobody is kept out, and files are still written whole.
fcntl: Any = import_module("fcntl") if find_spec("fcntl") else None
_TAKEN = {errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES}


@contextmanager
def alone(path: Path, what: str) -> Iterator[None]:
    """Hold the lock file ``path``, made if missing, while the body runs; it stays there, and says who held it last.

    The lock is on the open file: it goes with its owner, however that ends, and another thread does not share it.
    Raises `StorageError` if ``what`` is another's at the moment, or the file cannot be written.
    """
    handle = _opened(path, what)
    try:
        _claim(handle, path, what)
        yield
    finally:
        os.close(handle)


def _claim(handle: int, path: Path, what: str) -> None:
    if not _locked(handle):
        owner = os.read(handle, 200).decode(errors="replace").strip() or "unknown"
        raise StorageError(
            f"another process ({owner}) is working on {what}",
            str(path.parent),
            "wait until it has ended, or name another folder",
        )
    if fcntl is not None:
        with suppress(OSError):  # on a full disk the lock holds without a name in it
            os.ftruncate(handle, 0)
            os.write(handle, f"{os.getpid()} on {socket.gethostname()}\n".encode())


def _opened(path: Path, what: str) -> int:
    try:
        make_folder(path.parent)
        return os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise unwritable(what, path, error) from None


def _locked(handle: int, shared: bool = False) -> bool:
    """Whether an open file is locked now; where there are no locks it counts as such, for nobody can be kept out."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(handle, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except OSError as error:
        return error.errno not in _TAKEN
    return True


@contextmanager
def held(path: Path, wait: float = 0.0) -> Iterator[bool]:
    """Whether the lock at ``path`` is ours, which it stays inside; another owner is waited for as long as ``wait`` s.

    The file is there while somebody has the lock, or died with it. Raises `StorageError` where it cannot be made.
    """
    handle = _waited_for(path, time.monotonic() + wait)
    try:
        yield handle is not None
    finally:
        if handle is not None:
            path.unlink(missing_ok=True)
            os.close(handle)


def _waited_for(path: Path, latest: float) -> int | None:
    """An open file that we have locked; None if another owner has it at the time ``latest``."""
    while True:
        handle = _opened(path, "the lock")
        if not _locked(handle):
            os.close(handle)
            if time.monotonic() >= latest:
                return None
            time.sleep(LOOK)
            continue
        if _is_at(path, handle):
            return handle
        os.close(handle)  # its owner has just removed it: whoever comes next makes another one


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
        return not _locked(handle, shared=True)
    finally:
        os.close(handle)
