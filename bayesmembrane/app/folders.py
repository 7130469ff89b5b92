"""What lies in folders: runs and stored answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bayesmembrane.calibration.run import load_run, run_folders
from bayesmembrane.calibration.store import ASKED
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.files import check_folder
from bayesmembrane.ground.stored import answer_folders, damaged_answers, read, stored_kinds
from bayesmembrane.words.language import listed

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

    Raises `StorageError` for a folder that holds neither, or nothing that can be read.
    """
    found: dict[Lying, None] = {}
    for folder in folders:
        check_folder(folder)
        here = lying_in(folder)
        if not here:
            raise _nothing(folder)
        found |= dict.fromkeys(here)
    return list(found)


def lying_in(folder: Path) -> list[Lying]:
    """The runs and answers in ``folder``, or in the folders right under it; none if there are none."""
    runs = [Lying(path, RUN) for path in run_folders(folder) if (path / ASKED).is_file()]
    return runs + [Lying(path, kind) for path in answer_folders(folder) for kind in stored_kinds(path)]


def _nothing(folder: Path) -> StorageError:
    """The error for a folder without a run and an answer: those that cannot be read are named."""
    if damaged := damaged_answers(folder):
        names = listed(str(path.relative_to(folder)) for path in damaged)
        return StorageError(f"what is stored in the folder cannot be read: {names}", str(folder), "compute it again")
    return StorageError(
        "there is no run and no answer in the folder", str(folder), "name a folder that sample or fit wrote"
    )
