"""Solved curves in one SQLite file that several processes share and that does not grow without end."""

from __future__ import annotations

import io
import sqlite3
import time
import zipfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.parameters import Array

FILE = "curves.sqlite"
MOST_BYTES = 256 * 2**20
"""Of all entries together; beyond it those go that were not asked for the longest."""
EVICTED = 0.1  # of the room, at least, whenever it is full: so that this is seldom
PATIENCE = 60.0  # seconds that a process waits for another one that writes

SCHEMA = """
CREATE TABLE IF NOT EXISTS curves (key BLOB PRIMARY KEY, entry BLOB NOT NULL, used REAL NOT NULL) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS by_use ON curves (used);
"""
# Pages that hold something: the file itself keeps the room of what was evicted, and uses it again.
USED = """SELECT (p.page_count - f.freelist_count) * s.page_size
FROM pragma_page_count() AS p, pragma_freelist_count() AS f, pragma_page_size() AS s"""
_DAMAGED = (ValueError, KeyError, EOFError, zipfile.BadZipFile)

Entry = dict[str, Array]


class DamagedError(Exception):
    """What was found cannot be read; it is gone now, and can be made again."""


@dataclass(frozen=True)
class CurveShelf:
    """Entries by key in ``folder``/curves.sqlite. A connection lives for one call: nothing is held between them."""

    folder: Path
    most_bytes: int = MOST_BYTES

    @property
    def path(self) -> Path:
        return self.folder / FILE

    def read(self, key: bytes) -> Entry | None:
        """The entry, or None; raises `DamagedError` where it could not be read and was removed."""
        if not self.path.exists():
            return None
        with self._open() as file:
            row = file.execute("SELECT entry FROM curves WHERE key = ?", (key,)).fetchone()
            entry = _loaded(row[0]) if row is not None else None
            if entry is not None:
                file.execute("UPDATE curves SET used = ? WHERE key = ?", (time.time(), key))
            elif row is not None:
                file.execute("DELETE FROM curves WHERE key = ?", (key,))
        if row is not None and entry is None:
            raise DamagedError
        return entry

    def write(self, key: bytes, entry: Entry) -> None:
        """Keep the entry; the oldest go where there is no room. Raises `StorageError`, or `DamagedError` as `read`."""
        buffer = io.BytesIO()
        np.savez(buffer, **entry)  # type: ignore[arg-type]
        with self._open() as file:
            file.execute("INSERT OR REPLACE INTO curves VALUES (?, ?, ?)", (key, buffer.getvalue(), time.time()))
            held = file.execute(USED).fetchone()[0]
            if held > self.most_bytes:
                self._evict(file, held - (1 - EVICTED) * self.most_bytes)

    @staticmethod
    def _evict(file: sqlite3.Connection, surplus: float) -> None:
        """Remove the entries that were not asked for the longest, until ``surplus`` bytes are gone."""
        for key, size in file.execute("SELECT key, LENGTH(entry) FROM curves ORDER BY used").fetchall():
            if surplus <= 0:
                break
            file.execute("DELETE FROM curves WHERE key = ?", (key,))
            surplus -= size

    @contextmanager
    def _open(self) -> Iterator[sqlite3.Connection]:
        """A transaction, committed at the end and synced by SQLite; a file that is no database is removed."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with closing(sqlite3.connect(self.path, timeout=PATIENCE)) as file, file:
                file.executescript(SCHEMA)
                yield file
        except sqlite3.OperationalError as error:
            raise self._refused(str(error)) from None
        except sqlite3.DatabaseError:
            self.path.unlink(missing_ok=True)
            raise DamagedError from None
        except OSError as error:
            raise self._refused(error.strerror or str(error)) from None

    def _refused(self, reason: str) -> StorageError:
        return StorageError(
            f"the curve cache cannot be written ({reason})",
            where=str(self.path),
            remedy="free some space, make the folder writable, or choose another one with --out",
        )


def _loaded(data: bytes) -> Entry | None:
    """The arrays that `CurveShelf.write` stored; None if they are not all there."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except _DAMAGED:
        return None
