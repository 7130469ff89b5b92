"""What is written of a reconstruction replaces an earlier one, and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from bayesmembrane.ground.errors import StorageError
from bayesmembrane.reconstruction.files import STATEMENT, refuse_others


def files(folder: Path) -> dict[Path, str]:
    return {folder / name: "new" for name in ("a.csv", "a_covariance.csv", "a.toml")}


@pytest.mark.parametrize("name", ["a.csv", "a_covariance.csv", "a.toml"])
def test_what_is_no_reconstruction_stays(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("mine")
    with pytest.raises(StorageError, match=f"{name}: the file exists already, and is no reconstruction"):
        refuse_others(files(tmp_path))


def test_an_earlier_one_is_replaced(tmp_path: Path) -> None:
    refuse_others(files(tmp_path))
    (tmp_path / "a.csv").write_text("old")
    (tmp_path / "a.toml").write_text(f'[origin]\nstatement = "{STATEMENT}"\n')
    refuse_others(files(tmp_path))
