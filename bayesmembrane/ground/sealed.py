"""Files that tell whether they are what was written: each holds a checksum of itself.

TOML has it in a comment on its first line, JSON under the first key, any other file in 73 bytes after its end, which
readers of netCDF and HDF5 pass over. A file without one was written by an earlier version, and is taken as it is.
"""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w

from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.files import write_text
from bayesmembrane.ground.plain import json_text, plain

KEY = "sha256"
AGAIN = "remove this file and sample again; what was walked before is kept beside it"
_LINE, _END = f"# {KEY} ", f"\n{KEY} ".encode()
_LENGTH = len(_END) + 64 + 1


def write_toml(path: Path, values: Mapping[str, Any], what: str) -> None:
    """Write plain ``values``, sealed; raises `StorageError` if that cannot be."""
    body = tomli_w.dumps(values)
    write_text(path, f"{_LINE}{_sha(body.encode())} of all that follows\n{body}", what)


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """What `write_toml` wrote; raises `StorageError` if it cannot be read, or is not what was written."""
    text = _text(path, what)
    first, _, body = text.partition("\n")
    sealed = first.startswith(_LINE)
    if sealed and first.split()[2] != _sha(body.encode()):
        raise damaged(path, what, "its content is not what was written")
    try:
        return tomllib.loads(body if sealed else text)
    except (ValueError, RecursionError):
        raise damaged(path, what, "it is no whole TOML document") from None


def write_json(path: Path, values: Mapping[str, Any], what: str, indent: int | None = 1) -> Path:
    """Write ``values`` as `plain` ones, sealed, and return ``path``; raises `StorageError` if that cannot be."""
    body = plain(values)
    return write_text(path, json_text({KEY: _sha(_canonical(body)), **body}, indent=indent), what)


def read_json(path: Path, what: str, remedy: str = AGAIN) -> dict[str, Any]:
    """What `write_json` wrote; raises `StorageError` if it cannot be read, or is not what was written."""
    try:
        content = json.loads(_text(path, what, remedy))
        if not isinstance(content, dict):
            raise ValueError
        found = content.pop(KEY, None)
        if found is not None and found != _sha(_canonical(content)):
            raise damaged(path, what, "its content is not what was written", remedy)
    except (ValueError, RecursionError):
        raise damaged(path, what, "it is no whole JSON document", remedy) from None
    return content


def sealed(content: bytes) -> tuple[bytes, str]:
    """The content of a file with its checksum after the end, and that checksum."""
    found = hashlib.sha256(content).hexdigest()
    return content + _END + found.encode() + b"\n", found


def checked(path: Path, what: str, remedy: str = AGAIN) -> str:
    """The checksum that `sealed` put after a file, "" if there is none.

    Raises `StorageError` if the file cannot be read, or is not what was written.
    """
    try:
        with path.open("rb") as file:
            size = file.seek(0, 2)
            file.seek(max(0, size - _LENGTH))
            end = file.read()
            if not (end.startswith(_END) and end.endswith(b"\n") and len(end) == _LENGTH):
                return ""
            file.seek(0)
            found, left = hashlib.sha256(), size - _LENGTH
            while left:
                block = file.read(min(left, 2**20))
                if not block:
                    break
                found.update(block)
                left -= len(block)
    except OSError as error:
        raise damaged(path, what, error.strerror or str(error), remedy) from None
    if found.hexdigest().encode() != end[len(_END) : -1]:
        raise damaged(path, what, "its content is not what was written", remedy)
    return found.hexdigest()


def is_sealed(path: Path) -> bool:
    """Whether a TOML or JSON file says that it has a checksum."""
    try:
        with path.open("rb") as file:
            return KEY.encode() in file.read(40)
    except OSError as error:
        raise damaged(path, "the file", error.strerror or str(error)) from None


def damaged(path: Path, what: str, reason: str, remedy: str = AGAIN) -> StorageError:
    """The error that says why a stored file cannot be used, and what to do."""
    return StorageError(f"{what} is damaged ({reason})", str(path), remedy)


def _text(path: Path, what: str, remedy: str = AGAIN) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise damaged(path, what, error.strerror or str(error), remedy) from None
    except UnicodeDecodeError:
        raise damaged(path, what, "it is no text in UTF-8", remedy) from None


def _canonical(values: Any) -> bytes:
    return json.dumps(values, sort_keys=True).encode()


def _sha(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
