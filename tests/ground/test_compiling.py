"""Compiled code on the disk: found again, and no state of the disk gives another answer or a traceback."""

from __future__ import annotations

import errno
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numba
import pytest
from numba.core.caching import IndexDataCacheFile

from bayesmembrane.ground import compiling
from bayesmembrane.ground.compiling import _Copies, compilation, compiled

CODE = """
def f(x):
    return x + {}
"""


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "kept"))
    monkeypatch.setattr(_Copies, "failed", False)
    return tmp_path


def made(place: Path, added: int) -> Any:
    """f of a module that was written with this number, as a process finds it."""
    file = place / "module.py"
    file.write_text(CODE.format(added))
    names: dict[str, Any] = {"__file__": str(file), "__name__": __name__}
    exec(compile(file.read_text(), str(file), "exec"), names)
    return compiled(nogil=True)(names["f"])


def test_code_is_found_again(place: Path) -> None:
    assert made(place, 1)(1) == 2
    again = made(place, 1)
    assert again(1) == 2
    assert sum(again.stats.cache_hits.values()) == 1


@pytest.mark.parametrize("ending", ["nbc", "nbi"])
@pytest.mark.parametrize("content", [b"", b"\x80\x04garbage"])
def test_damaged_code_is_compiled_again(place: Path, ending: str, content: bytes) -> None:
    assert made(place, 1)(1) == 2
    (file,) = place.rglob(f"*.{ending}")
    file.write_bytes(content)
    assert made(place, 1)(1) == 2
    third = made(place, 1)
    assert third(1) == 2
    assert sum(third.stats.cache_hits.values()) == 1


@pytest.mark.parametrize("fails_at", ["_save_data", "_save_index"])
def test_a_disk_that_fills_up_costs_time_only(place: Path, fails_at: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also once the function has changed: never is code of the older one run."""

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    assert made(place, 1)(1) == 2
    with monkeypatch.context() as patch:
        patch.setattr(IndexDataCacheFile, fails_at, full)
        assert made(place, 20)(1) == 21
    assert made(place, 20)(1) == 21


def test_where_nothing_can_be_written_it_is_compiled_each_time(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", "/proc/none")
    assert made(place, 1)(1) == 2


@pytest.fixture
def copied(place: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Tests may run in another thread than the first one."""
    if not hasattr(os, "fork"):
        pytest.skip("no copies here")
    monkeypatch.setattr(_Copies, "serve", lambda: not (_Copies.failed or _Copies.inside))
    return place


def test_a_copy_of_this_process_compiles_and_its_code_is_used(copied: Path) -> None:
    with compilation() as here:
        function = made(copied, 1)
        assert function(1) == 2
    assert here.seconds == 0.0
    assert sum(function.stats.cache_hits.values()) == 1


def test_where_copies_fail_it_is_compiled_here(copied: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling, "_alone", lambda: os._exit(0))
    for added in (1, 2):
        with compilation() as here:
            assert made(copied, added)(1) == 1 + added
        assert here.seconds > 0.0
        assert _Copies.failed


def test_threads_compile_for_themselves(place: Path) -> None:
    with ThreadPoolExecutor(1) as pool, compilation() as here:
        assert pool.submit(lambda: made(place, 1)(1)).result() == 2
    assert here.seconds > 0.0
