"""One process at a time: a lock that the operating system takes from an owner who is dead."""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.files import make_folder, unwritable

# Windows has no flock; there nobody is kept out, and files are still written whole.
fcntl: Any = import_module("fcntl") if find_spec("fcntl") else None
_TAKEN = {errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES}


@contextmanager
def alone(path: Path, what: str) -> Iterator[None]:
    """Hold the lock file ``path``, made if missing, while the body runs; it stays there, and says who held it last.

    The lock is on the open file: it goes with its owner, however that ends, and another thread does not share it.
    Raises `StorageError` if ``what`` is another's at the moment, or the file cannot be written.
    """
    try:
        make_folder(path.parent)
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise unwritable(what, path, error) from None
    try:
        _take(handle, path, what)
        yield
    finally:
        os.close(handle)


def _take(handle: int, path: Path, what: str) -> None:
    if fcntl is None:
        return
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno not in _TAKEN:  # a file system without locks: nobody can be kept out
            return
        owner = os.read(handle, 200).decode(errors="replace").strip() or "unknown"
        raise StorageError(
            f"another process ({owner}) is working on {what}",
            str(path.parent),
            "wait until it has ended, or name another folder",
        ) from None
    with suppress(OSError):  # on a full disk the lock holds without a name in it
        os.ftruncate(handle, 0)
        os.write(handle, f"{os.getpid()} on {socket.gethostname()}\n".encode())
