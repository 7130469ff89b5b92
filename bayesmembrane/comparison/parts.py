"""The parts of a comparison beside their run, in its folder ``comparison``, so that each is computed once.

bridge, nested, again, loo, widths, range and modes, each with the key of what it was made from. A part that takes long
is kept in pieces (nested-run-2) until it is there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from bayesmembrane.calibration.store import ASKED, STATUS, is_finished, read_asked
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.pieces import stored_once
from bayesmembrane.ground.sealed import read_json

FOLDER = "comparison"

Part = TypeVar("Part")


def run_folder(out: Path, name: str, asked: dict[str, Any]) -> Path:
    """The folder in ``out`` of the run that was ``asked`` for: one that serves, or else the one called ``name``."""
    for path in sorted(out.glob(f"*/{ASKED}")):
        if serves(path.parent, asked):
            return path.parent
    return out / name


def serves(folder: Path, asked: Mapping[str, Any]) -> bool:
    """Whether a folder holds a finished run with the same data, hypothesis, seed and code, and no fewer draws."""
    try:
        held = read_asked(folder)
        same = all(held[part] == asked[part] for part in ("seed", "hypothesis", "code"))
        same = same and held["data"]["sha256"] == asked["data"]["sha256"]
        if not same or not is_finished(folder):
            return False
        return bool(read_json(folder / STATUS, STATUS)["ess_bulk"] >= asked["sampling"]["ess"])
    except (StorageError, KeyError, TypeError):
        return False


def kept(run: Path | None, name: str, key: str, make: Callable[[], Part]) -> Part:
    """What ``make`` returns; read from the folder of the ``run`` if that was made with the same ``key``.

    Raises `StorageError` if it cannot be written. A part that cannot be read is made again.
    """
    if run is None:
        return make()
    return stored_once(run / FOLDER, name, key, make)


def drop_pieces(run: Path | None, name: str) -> None:
    """Remove the pieces of a part that is there: files called ``<name>-...``."""
    for path in [] if run is None else (run / FOLDER).glob(f"{name}-*"):
        path.unlink(missing_ok=True)
