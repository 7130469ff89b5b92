"""What tests of the command line share."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from bayesmembrane.app.cli import main


@pytest.fixture(autouse=True)
def _unrendered(blank_pictures: None) -> None:
    """Pages of the command line are read here; those that other processes make have their pictures."""


@pytest.fixture
def run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Callable[..., tuple[int, str, str]]:
    """The program in an empty folder: (status, stdout, stderr) of its arguments."""
    monkeypatch.chdir(tmp_path)  # what is not sent elsewhere is stored in chains/ here

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["bayesmembrane", *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            main()
        out, err = capsys.readouterr()
        return int(stop.value.code or 0), out, err

    return call
