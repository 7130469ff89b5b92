"""Pieces of a long computation: made once, read back as they were, and only for the same question."""

from pathlib import Path

import numpy as np

from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.pieces import FOLDER, drop, keeping, piece, within


def made(calls: list[str], name: str, value: float) -> tuple[float, Array]:
    def make() -> tuple[float, Array]:
        calls.append(name)
        return value, np.array([value, 0.1])

    return piece(name, make)


def test_a_piece_is_made_once_for_a_question(tmp_path: Path) -> None:
    calls: list[str] = []
    for key, value in (("asked", 1.5), ("asked", 2.5), ("asked otherwise", 2.5)):
        with keeping(tmp_path, key):
            found, array = made(calls, "a", value)
        assert found == (1.5 if key == "asked" else 2.5)
        assert np.array_equal(array, [found, 0.1])
    assert calls == ["a", "a"]


def test_without_a_folder_nothing_is_kept(tmp_path: Path) -> None:
    calls: list[str] = []
    for _ in range(2):
        made(calls, "a", 1.0)
        with keeping(None, "asked"), within("part"):
            made(calls, "a", 1.0)
    assert len(calls) == 4
    assert not list(tmp_path.iterdir())


def test_parts_have_their_own_names_and_a_piece_hides_those_in_it(tmp_path: Path) -> None:
    calls: list[str] = []
    with keeping(tmp_path, "asked"):
        for part, value in (("one", 1.0), ("two", 2.0)):
            with within(part), within("0"):
                assert made(calls, "a", value)[0] == value
        assert piece("outer", lambda: made(calls, "inner", 3.0))[0] == 3.0
    assert {p.stem for p in (tmp_path / FOLDER).glob("*.json")} == {"one-0-a", "two-0-a", "outer"}
    drop(tmp_path)
    drop(tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_damaged_piece_is_made_again(tmp_path: Path) -> None:
    calls: list[str] = []
    for _ in range(2):
        with keeping(tmp_path, "asked"):
            assert made(calls, "a", 1.0)[0] == 1.0
        (tmp_path / FOLDER / "a.npz").write_bytes(b"")
    assert calls == ["a", "a"]
