"""A file is written whole or not at all, and synced before it is seen."""

import os
from pathlib import Path

import pytest

from bayesmembrane.ground import files
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.files import ensure_writable, write_text, write_whole


def test_what_was_written_is_read(tmp_path):
    path = write_text(tmp_path / "a" / "b.txt", "5 µm")
    assert path.read_text(encoding="utf-8") == "5 µm"
    assert [p.name for p in path.parent.iterdir()] == ["b.txt"]


def test_a_writer_that_fails_leaves_the_old_file_alone(tmp_path):
    path = write_text(tmp_path / "b.txt", "old")

    def half(part: Path) -> None:
        part.write_text("ne")
        raise KeyError("in the middle")

    with pytest.raises(KeyError):
        write_whole(path, half)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["b.txt"]


def test_file_then_rename_then_folder(tmp_path, monkeypatch):
    """The order that a power cut asks for."""
    seen = []
    fsync, replace = os.fsync, Path.replace
    monkeypatch.setattr(
        files.os, "fsync", lambda handle: (seen.append(os.readlink(f"/proc/self/fd/{handle}")), fsync(handle))
    )
    monkeypatch.setattr(Path, "replace", lambda part, path: (seen.append("rename"), replace(part, path)))
    write_text(tmp_path / "b.txt", "new")
    assert Path(seen[0]).name.startswith(".b.txt.")
    assert seen[1:] == ["rename", str(tmp_path)]


def test_a_full_disk_is_a_sentence(tmp_path, monkeypatch):
    path = write_text(tmp_path / "b.txt", "old")

    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", full)
    with pytest.raises(StorageError, match=r"the answer cannot be written \(No space left"):
        write_text(path, "new", "the answer")
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["b.txt"]


def test_new_folders_are_synced_into_those_that_hold_them(tmp_path, monkeypatch):
    """Else a power cut takes all of a new folder along, whatever was synced in it."""
    seen = []
    monkeypatch.setattr(files, "_sync", seen.append)
    files.make_folder(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
    assert seen == [tmp_path, tmp_path / "a"]


def test_what_cannot_be_written_is_told_before_the_work(tmp_path):
    ensure_writable(tmp_path / "new" / "folder")
    assert list((tmp_path / "new" / "folder").iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match=r"the answer cannot be written \(.*") as fault:
        ensure_writable(tmp_path / "file" / "folder")
    assert "name another one" in str(fault.value)
