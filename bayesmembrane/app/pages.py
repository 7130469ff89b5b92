"""From folders to a page: whatever answers and runs lie there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bayesmembrane.calibration.beside_paper import Compared
from bayesmembrane.calibration.run import Run, load_run, run_folders
from bayesmembrane.calibration.store import ASKED
from bayesmembrane.comparison.result import Comparison
from bayesmembrane.diagnosis.loop import Loop
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.stored import answer_folders, read, stored_kinds
from bayesmembrane.reconstruction.result import Reconstruction
from bayesmembrane.report.page import write_report
from bayesmembrane.valleys.result import Valleys


@dataclass(frozen=True, eq=False)
class Found:
    """A result that lies in a folder; ``kind`` is "run", or one of `ground.stored.KINDS`."""

    folder: Path
    kind: str
    result: Any


def gathered(folders: Sequence[Path]) -> list[Found]:
    """All runs and answers in ``folders``, or in the folders right under them, each once.

    Raises `StorageError` for a folder that holds neither, or something damaged.
    """
    found: dict[tuple[Path, str], Found] = {}
    for folder in folders:
        here = [(path, "run") for path in run_folders(folder) if (path / ASKED).is_file()]
        here += [(path, kind) for path in answer_folders(folder) for kind in stored_kinds(path)]
        if not here:
            raise StorageError(
                "there is no run and no answer in the folder", str(folder), "name a folder that sample or fit wrote"
            )
        for path, kind in here:
            if (path, kind) not in found:
                found[path, kind] = Found(path, kind, load_run(path) if kind == "run" else read(path, kind))
    return list(found.values())


def write(results: Sequence[Any], out: Path, title: str | None = None) -> Path:
    """The page about ``results`` in the folder ``out``; returns its path."""
    runs = _of(results, Run)
    comparisons = {name: c for each in _of(results, dict) for name, c in each.items() if isinstance(c, Comparison)}
    return write_report(
        runs,
        out,
        reconstruction=next(iter(_of(results, Reconstruction)), None),
        fits=_of(results, Compared),
        title=title,
        valleys=_of(results, Valleys),
        comparison=comparisons,
        loops=_of(results, Loop),
    )


def _of(results: Sequence[Any], kind: type[Any]) -> list[Any]:
    return [result for result in results if isinstance(result, kind)]
