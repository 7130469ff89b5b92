"""TOML files read with care: every key asked for is checked, and every key not asked for is an error."""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from pathlib import Path
from typing import Any

from bayesmembrane.data.tables import read_text
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.units import factor, known_units, split_header, to_si


def load_toml(path: Path) -> TomlSection:
    """The root section of a TOML file; raises `DataError` if it cannot be read, with the line of a syntax error."""
    text = read_text(path)
    try:
        return TomlSection(tomllib.loads(text), str(path))
    except (ValueError, RecursionError) as error:
        fault, remedy = not_toml(text, error)
        raise DataError(fault, str(path), remedy) from None


def load_specimen(path: Path) -> TomlSection:
    """The root section of the TOML file of a specimen; raises `DataError` if it cannot be read or has no section."""
    root = load_toml(path)
    if not root.table:
        remedy = 'write [specimen] with thickness_um, and [rig] with its lengths and kind = "annulus", or another kind'
        raise DataError("the file says nothing of film and rig", str(path), remedy)
    return root


def not_toml(text: str, error: ValueError | RecursionError) -> tuple[str, str]:
    """(fault, remedy) of a text that ``tomllib`` refused with ``error``."""
    if isinstance(error, RecursionError):
        return "this is not valid TOML: it is nested too deeply", "write it flat, as the examples are"
    line = re.search(r"at line (\d+)", str(error))
    content = text.split("\n")[int(line[1]) - 1 :][:1] if line else []
    bare = re.search(r"[=\[,]\s*([-+]?)(\d*\.\d*)\s*(?:[],#]|$)", content[0]) if content else None
    if bare and len(bare[2]) > 1 and not (bare[2][0].isdigit() and bare[2][-1].isdigit()):
        remedy = f"a number has digits on both sides of its point: write {bare[1]}{_with_digits(bare[2])}"
    else:
        remedy = "texts stand in quotes, and numbers have decimal points"
    return f"this is not valid TOML: {error}", remedy


def _with_digits(number: str) -> str:
    """``.003`` -> ``0.003``, ``5.`` -> ``5.0``."""
    before, after = number.split(".")
    return f"{before or '0'}.{after or '0'}"


class TomlSection:
    """One table of a TOML file. Ask for its keys, then call `finish`, which complains about the others."""

    def __init__(self, table: dict[str, Any], file: str, name: str = "") -> None:
        self.table, self.file, self.name = table, file, name
        self.where = f"{file}, [{name}]" if name else file
        self._asked: set[str] = set()
        self._seen: set[str] = set()

    def section(self, name: str, required: bool = True) -> TomlSection:
        """The section ``[name]``; an empty one if it is missing and not required."""
        self._note(name, name)
        if name not in self.table and required:
            raise DataError(f"the section [{name}] is missing", self.where, self._like(name) or "add it")
        table = self.table.get(name, {})
        if not isinstance(table, dict):
            raise DataError(f'"{name}" must be a section', self.where, f"write [{name}] on a line of its own")
        return TomlSection(table, self.file, name)

    def text(self, key: str, required: bool = False) -> str | None:
        """The text under ``key``, None if there is none."""
        self._note(key, key)
        value = self.table.get(key)
        if value is None and not required:
            return None
        if value is None:
            raise DataError(f"the key {key} is missing", self.where, self._like(key) or f'add {key} = "..."')
        if not isinstance(value, str) or not value.strip():
            raise DataError(f"{key} must be a text in quotes, and it is {_shown(value)}", self.where)
        return value

    def measure(
        self, name: str, quantity: str, example: str, required: bool = True, like: float | None = None
    ) -> float | None:
        """The number under ``name_<unit>`` in SI, None if there is none and it is not required.

        ``example`` is such a key, and ``like`` a usual value of it.
        """
        keys = [k for k in self.table if split_header(k)[0] == name]
        self._note(example, *keys)
        if len(keys) > 1:
            raise DataError(f"{' and '.join(keys)} both give the {name}", self.where, "remove one of them")
        if not keys:
            self._refuse_unit(name, quantity)
            if required:
                add = f"add it with its value, {'a number' if like is None else f'as in {example} = {like:g}'}"
                raise DataError(f"the key {example} is missing", self.where, self._like(example) or add)
            return None
        unit = split_header(keys[0])[1]
        if not unit and "" not in known_units(quantity):
            raise DataError(f"the key {keys[0]} names no unit", self.where, f"call it {example}")
        return to_si(self._number(keys[0]), factor(unit, quantity, f"{self.where}, {keys[0]}"))

    def positive(self, name: str, quantity: str, example: str, required: bool, like: float) -> float | None:
        """As `measure`, of what must be above zero."""
        value = self.measure(name, quantity, example, required, like)
        if value is not None and value <= 0:
            key = next(k for k in self.table if split_header(k)[0] == name)
            given = f"{self._number(key):g} {split_header(key)[1]}"
            fault = f"{key} must be a positive {quantity}, and {given} is not"
            raise DataError(fault, self.where, f"correct it, as in {example} = {like:g}")
        return value

    def all_text(self) -> str:
        """Every key with its value, for sections whose content is free."""
        self._note("", *self.table)
        return "; ".join(f"{k}: {v}" for k, v in self.table.items())

    def all_known(self, *keys: str) -> None:
        """Say of ``keys`` that they may be there: who asked looks at their values without help."""
        for key in keys:
            self._note(key, key)

    def finish(self) -> None:
        """Raise `DataError` for the first key that nobody asked for, with the nearest one that was."""
        for key in self.table:
            if key not in self._seen:
                known = sorted(self._asked - {""})
                nearest = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
                guess = f'did you mean "{nearest[0]}"? ' if nearest else ""
                raise DataError(f'the key "{key}" is unknown', self.where, f"{guess}known: {', '.join(known)}")

    def _note(self, asked: str, *keys: str) -> None:
        self._asked.add(asked)
        self._seen.update(keys)

    def _refuse_unit(self, name: str, quantity: str) -> None:
        for key in self.table:
            if key.startswith(f"{name}_"):
                factor(key[len(name) + 1 :], quantity, f"{self.where}, {key}")

    def _like(self, key: str) -> str:
        unread = [k for k in self.table if k not in self._seen]
        nearest = difflib.get_close_matches(key, unread, n=1, cutoff=0.6)
        return f'rename "{nearest[0]}" if that is it' if nearest else ""

    def _number(self, key: str) -> float:
        value = self.table[key]
        try:
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise TypeError
            return float(value)
        except (TypeError, OverflowError):
            raise DataError(f"{key} must be a finite number, and it is {_shown(value)}", self.where) from None


def _shown(value: object) -> str:
    try:
        text = repr(value)
    except (ValueError, RecursionError):
        text = f"a {type(value).__name__}"
    return text if len(text) <= 60 else text[:57] + "..."
