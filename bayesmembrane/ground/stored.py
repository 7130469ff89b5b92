"""Answers as files: ``<kind>.json`` with what was answered and the frozen result, ``<kind>.npz`` with its arrays.

A result comes back as it was, to the last bit (`ground.tree`). Both files carry a format number and checksums, so that
what was damaged or belongs to another program is told in a sentence and never half read.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.errors import BayesmembraneError, StorageError
from bayesmembrane.ground.files import write_text, write_whole
from bayesmembrane.ground.plain import plain
from bayesmembrane.ground.tree import Decoder, Encoder

PROGRAM, FORMAT = "bayesmembrane", 1

_START = f'{{"program": "{PROGRAM}"'
_FAULTS = (
    KeyError, TypeError, ValueError, AttributeError, ImportError, IndexError, RecursionError, OverflowError,
    zipfile.BadZipFile, EOFError,
)  # fmt: skip


def store(folder: Path, kind: str, result: Any, answer: Mapping[str, Any]) -> Path:
    """Write ``result`` and the JSON ``answer`` of its verb into ``folder`` (made if missing) and return ``folder``.

    Both files are written whole and synced, the one that makes the answer valid last; an older answer of this kind is
    replaced. Raises `StorageError` if they cannot be written, `TypeError` for a result that is no value.
    """
    folder = Path(folder)
    encoder = Encoder(folder)
    tree = encoder(result)
    packed = _packed(encoder.arrays)
    body = json.dumps({"answer": plain(answer), "result": tree}, allow_nan=False)
    head = {
        "program": PROGRAM,
        "format": FORMAT,
        "kind": kind,
        "arrays_sha256": hashlib.sha256(packed).hexdigest(),
        "sha256": hashlib.sha256(body.encode()).hexdigest(),
    }
    document, arrays = _files(folder, kind)
    try:
        document.unlink(missing_ok=True)
    except OSError as error:
        raise StorageError(f"the {kind} cannot be replaced ({error.strerror})", str(document)) from None
    write_whole(arrays, lambda part: part.write_bytes(packed), f"the {kind}")
    write_text(document, f"{json.dumps(head)[:-1]}, {body[1:]}\n", f"the {kind}")
    return folder


def read(folder: Path, kind: str) -> Any:
    """The result of this ``kind`` that is stored in ``folder``, as it was; None if there is none.

    A file of this name that some other program wrote is none; beside arrays of this name it is taken for a damaged one.
    Raises `StorageError` if the answer is damaged, or of another format or version.
    """
    document, arrays = _files(Path(folder), kind)
    if not _stored(document):
        return None
    content = _document(document, kind)
    try:
        packed = arrays.read_bytes()
    except OSError as error:
        raise _damaged(arrays, kind, error.strerror or str(error)) from None
    if hashlib.sha256(packed).hexdigest() != content["arrays_sha256"]:
        raise _damaged(arrays, kind, "its content is not what was written")
    try:
        return Decoder(Path(folder), _unpacked(packed))(content["result"])
    except BayesmembraneError as error:
        raise StorageError(
            f"the stored {kind} cannot be read: {error}".rstrip("."), str(document), "see to that, or compute it again"
        ) from None
    except _FAULTS as error:
        reason = f"it was written by another version: {type(error).__name__}, {error}"
        raise _damaged(document, kind, reason) from None


def answer(folder: Path, kind: str) -> dict[str, Any] | None:
    """The JSON answer of the verb, stored beside the result; None if there is none. Raises as `read` does."""
    document, _ = _files(Path(folder), kind)
    return dict(_document(document, kind)["answer"]) if _stored(document) else None


def stored_kinds(folder: Path) -> tuple[str, ...]:
    """The kinds of answers that lie in ``folder``; files of the same name that this program did not store are none."""
    found = [path for path in sorted(Path(folder).glob("*.json")) if path.with_suffix(".npz").is_file()]
    return tuple(path.stem for path in found if _begins(path))


def answer_folders(place: Path) -> list[Path]:
    """``place`` itself if answers lie in it, and the folders right under it that hold some, sorted by name."""
    place = Path(place)
    inner = sorted(p for p in place.iterdir() if p.is_dir()) if place.is_dir() else []
    return [folder for folder in (place, *inner) if stored_kinds(folder)]


def damaged_answers(place: Path) -> list[Path]:
    """Documents in ``place``, or right under it, beside arrays of their name, that do not begin as an answer does."""
    found = sorted([*Path(place).glob("*.json"), *Path(place).glob("*/*.json")])
    return [path for path in found if path.with_suffix(".npz").is_file() and not _begins(path)]


def _files(folder: Path, kind: str) -> tuple[Path, Path]:
    return folder / f"{kind}.json", folder / f"{kind}.npz"


def _stored(document: Path) -> bool:
    return document.is_file() and (document.with_suffix(".npz").is_file() or _begins(document))


def _begins(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return file.read(len(_START)) == _START.encode()
    except OSError:
        return False


def _document(path: Path, kind: str) -> dict[str, Any]:
    """What stands in ``path``, checked against its own checksum."""
    try:
        text = path.read_text(encoding="utf-8")
        content = json.loads(text)
    except OSError as error:
        raise StorageError(f"the stored {kind} cannot be read ({error.strerror})", str(path)) from None
    except (ValueError, RecursionError):
        raise _damaged(path, kind, "it is no whole JSON document") from None
    if not isinstance(content, dict) or content.get("program") != PROGRAM:
        raise StorageError(
            f"the file is no {kind} that this program stored", str(path), "name another folder, or remove the file"
        )
    if content.get("format") != FORMAT:
        raise StorageError(
            f"the {kind} is stored in format {content.get('format')}, and this version reads format {FORMAT}",
            str(path),
            "read it with the version that wrote it, or compute it again",
        )
    body = json.dumps({name: content.get(name) for name in ("answer", "result")})
    checked = hashlib.sha256(body.encode()).hexdigest() == content.get("sha256")
    if not checked or content.get("kind") != kind or "arrays_sha256" not in content:
        raise _damaged(path, kind, "its content is not what was written")
    return content


def _damaged(path: Path, kind: str, reason: str) -> StorageError:
    return StorageError(
        f"the stored {kind} cannot be read ({reason})", str(path), "remove the folder and compute it again"
    )


def _packed(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)  # type: ignore[arg-type]  # its stub takes the names for its own option
    return file.getvalue()


def _unpacked(packed: bytes) -> dict[str, NDArray[Any]]:
    with np.load(io.BytesIO(packed), allow_pickle=False) as held:
        return {name: held[name] for name in held.files}
