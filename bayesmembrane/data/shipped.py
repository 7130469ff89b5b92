"""Where the data that ship lie: ``data/`` of a checkout, ``bayesmembrane/_data`` of an installed wheel."""

from __future__ import annotations

from pathlib import Path

from bayesmembrane.ground.errors import unknown_name

_HERE = Path(__file__).resolve().parents[1]


def data_folder() -> Path:
    """The folder with the shipped measurements and tables."""
    installed = _HERE / "_data"
    return installed if installed.is_dir() else _HERE.parent / "data"


def shipped(name: str) -> Path:
    """The shipped file ``name``, a path relative to ``data/``; raises `SettingsError` with the nearest known names."""
    folder = data_folder()
    path = folder / name
    if path.is_file():
        return path
    known = [p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()]
    raise unknown_name("shipped file", name, known)
