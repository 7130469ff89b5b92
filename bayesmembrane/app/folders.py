"""What lies in folders: runs and stored answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bayesmembrane.calibration.run import load_run, run_folders
from bayesmembrane.calibration.store import ASKED
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.stored import answer_folders, read, stored_kinds

RUN = "run"


@dataclass(frozen=True)
class Lying:
    """Something that lies in a folder; ``kind`` is "run" or that of a stored answer."""

    folder: Path
    kind: str

    def read(self) -> Any:
        """The result; raises `StorageError` if it is damaged."""
        return load_run(self.folder) if self.kind == RUN else read(self.folder, self.kind)


def lying(folders: Sequence[Path]) -> list[Lying]:
    """All runs and answers in ``folders``, or in the folders right under them, each once.

    Raises `StorageError` for a folder that holds neither.
    """
    found: dict[Lying, None] = {}
    for folder in folders:
        here = [Lying(path, RUN) for path in run_folders(folder) if (path / ASKED).is_file()]
        here += [Lying(path, kind) for path in answer_folders(folder) for kind in stored_kinds(path)]
        if not here:
            raise StorageError(
                "there is no run and no answer in the folder", str(folder), "name a folder that sample or fit wrote"
            )
        found |= dict.fromkeys(here)
    return list(found)
