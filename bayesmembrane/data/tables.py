"""Numeric tables from text files, with errors that name file, line and column."""

from __future__ import annotations

import csv
import difflib
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.units import factor, known_units, split_header, to_si

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,4})?", re.ASCII)
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d{1,4})?", re.ASCII)
_NOT_FINITE = {"nan", "na", "n/a", "inf", "+inf", "-inf", "infinity", "-infinity", "null", "none"}
_LARGEST = 1e15
_IMPORT = "use `bayesmembrane import`"
MOST_BYTES = 2**28
_DELIMITERS = {";": "semicolons", "\t": "tabs"}


def read_text(path: Path) -> str:
    """The text of a UTF-8 file, whatever ends its lines; raises `DataError` if there is none, or it is not text."""
    try:
        data = read_bytes(path)
    except FileNotFoundError:
        raise DataError("there is no such file", str(path), "check the path") from None
    except IsADirectoryError:
        raise DataError("this is a folder", str(path), "name a file in it") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise DataError(f"the file cannot be read ({reason})", repr(str(path))[1:-1]) from None
    return decode(data, str(path))


def read_bytes(path: Path) -> bytes:
    """All of a file; raises OSError, and `DataError` for one that is larger than any measurement, or has no end."""
    with path.open("rb") as file:
        data = file.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise DataError(
            f"the file is larger than {MOST_BYTES // 2**20} MiB", str(path), "name a file that holds one measurement"
        )
    return data


def decode(data: bytes, file: str) -> str:
    """Bytes -> text as `read_text` does; ``file`` is what errors call them."""
    if b"\0" in data:
        raise DataError("this is not a text file", file, f"save it as CSV in UTF-8, or {_IMPORT} if it is an export")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise DataError("the text is not UTF-8", f"{file}, line {line}", "save the file as UTF-8") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


@dataclass(frozen=True)
class TextTable:
    """A header and rows of text, as they stand in a file.

    Attributes
    ----------
    file : what errors call the file
    header_line, header : line number and names of the C columns
    lines : (N,) line number of each row
    rows : (N,) tuples of cells; a row may be shorter or longer than the header
    decimal : the decimal sign
    """

    file: str
    header_line: int
    header: tuple[str, ...]
    lines: tuple[int, ...]
    rows: tuple[tuple[str, ...], ...]
    decimal: str = "."

    def find(self, name: str, quantity: str) -> tuple[int, float] | None:
        """(index, factor to SI) of the column ``name_<unit>``, None if there is none.

        Raises `DataError` if its unit is missing, unknown or of another quantity, or if two columns fit.
        """
        fits = [i for i, h in enumerate(self.header) if split_header(h)[0].lower() == name]
        if len(fits) > 1:
            names = " and ".join(f'"{self.header[i]}"' for i in fits)
            raise DataError(f"the columns {names} both give the {name}", self._place(), "remove one of them")
        if fits:
            unit = split_header(self.header[fits[0]])[1]
            if not unit and "" not in known_units(quantity):
                raise DataError(
                    f'the column "{self.header[fits[0]]}" names no unit',
                    self._place(),
                    f"call it {_example(name, quantity)}",
                )
            return fits[0], factor(unit, quantity, self._place(fits[0]))
        for i, h in enumerate(self.header):
            if h.lower().startswith(f"{name}_"):
                factor(h[len(name) + 1 :], quantity, self._place(i))
        return None

    def require(self, name: str, quantity: str) -> tuple[int, float]:
        """As `find`, but raises `DataError`, naming the nearest column, if there is none."""
        found = self.find(name, quantity)
        if found is not None:
            return found
        example = _example(name, quantity)
        nearest = difflib.get_close_matches(name, [split_header(h)[0].lower() for h in self.header], n=1, cutoff=0.5)
        like = next((h for h in self.header if nearest and split_header(h)[0].lower() == nearest[0]), None)
        guess = f'rename "{like}" if that is it' if like else f"name its columns with their units or {_IMPORT}"
        shown = ", ".join(h or '""' for h in self.header[:12])
        raise DataError(f"the column {example} is missing among {shown}", self._place(), guess)

    def column(self, index: int, scale: float = 1.0) -> Array:
        """(N,) the numbers of a column times ``scale``; raises `DataError` at the first cell that is no number."""
        return to_si(np.array([self._number(k, index) for k in range(len(self.rows))], dtype=float), scale)

    def _place(self, index: int | None = None) -> str:
        column = "" if index is None else f', column "{self.header[index]}"'
        return f"{self.file}, line {self.header_line}{column}"

    def _number(self, row: int, index: int) -> float:
        cells = self.rows[row]
        text = cells[index] if index < len(cells) else ""
        value = number(text, self.decimal)
        if value is None:
            raise _no_number(text, f"{self.file}, line {self.lines[row]}, column {self.header[index]}", self.decimal)
        return value


def parse_table(text: str, file: str, delimiter: str = ",", decimal: str = ".") -> TextTable:
    """The table in ``text``: the first line that is no comment (``#``) is the header, empty lines do not count.

    Raises `DataError` for another delimiter, decimal commas that split cells, a missing or repeated name.
    """
    lines = [
        (k, line) for k, line in enumerate(text.split("\n"), 1) if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        fault = "the file holds nothing but comments" if text.strip() else "the file is empty"
        raise DataError(fault, file, "export the measurement again")
    header_line, first = lines[0]
    _refuse_delimiter(first, delimiter, f"{file}, line {header_line}")
    rows = [(k, _cells(line, delimiter, f"{file}, line {k}")) for k, line in lines]
    header = rows.pop(0)[1]
    _check_header(header, f"{file}, line {header_line}")
    for k, cells in rows:
        _check_width(cells, header, f"{file}, line {k}", decimal)
    return TextTable(file, header_line, header, tuple(k for k, _ in rows), tuple(c for _, c in rows), decimal)


def read_matrix(path: Path) -> Array:
    """(N, M) the numbers of a file, split by commas or blanks, under at most one line of names.

    Raises `DataError` if it cannot be read, a cell is no number, or the lines differ in length.
    """
    numbered = enumerate(read_text(path).split("\n"), 1)
    lines = [(k, line) for k, line in numbered if line.strip() and not line.lstrip().startswith("#")]
    rows = [(k, [c.strip() for c in re.split(r"," if "," in line else r"\s+", line.strip())]) for k, line in lines]
    if rows and all(number(c) is None for c in rows[0][1]):
        rows = rows[1:]
    if not rows:
        raise DataError("the file holds no numbers", str(path))
    values = [[_matrix_entry(c, f"{path}, line {k}, column {j}") for j, c in enumerate(cells, 1)] for k, cells in rows]
    for (k, cells), row in zip(rows, values, strict=True):
        if len(row) != len(values[0]):
            raise DataError(
                f"the line has {len(cells)} numbers, and the first has {len(values[0])}", f"{path}, line {k}"
            )
    return np.array(values, dtype=float)


def number(text: str, decimal: str = ".") -> float | None:
    """The finite number that ``text`` writes with the decimal sign, None if it writes none (or one beyond 1e15)."""
    if decimal == ",":
        text = "?" if "." in text else text.replace(",", ".")
    if not _NUMBER.fullmatch(text):
        return None
    value = float(text)
    return value if abs(value) <= _LARGEST else None


def _no_number(text: str, where: str, decimal: str) -> DataError:
    shown = text if len(text) <= 40 else text[:37] + "..."
    if not text:
        return DataError("the cell is empty", where, "fill it or remove the line")
    if text.lower() in _NOT_FINITE:
        return DataError(f'"{shown}" is not a measured value', where, "remove the line")
    if decimal == "." and _DECIMAL_COMMA.fullmatch(text):
        return DataError(f'"{shown}" has a decimal comma', where, f"write {shown.replace(',', '.')} or {_IMPORT}")
    if _NUMBER.fullmatch(text):
        return DataError(f'"{shown}" is too large to be measured', where, "correct or remove the line")
    wanted = "1.5" if decimal == "." else "1,5"
    return DataError(f'"{shown}" is not a number', where, f"write it like {wanted} or remove the line")


def _matrix_entry(text: str, where: str) -> float:
    value = number(text)
    if value is None:
        raise _no_number(text, where, ".")
    return value


def _cells(line: str, delimiter: str, where: str) -> tuple[str, ...]:
    try:
        row = next(csv.reader([line], delimiter=delimiter))
    except csv.Error as error:
        raise DataError(f"the line cannot be split into cells ({error})", where, "correct or remove it") from None
    return tuple(cell.strip() for cell in row)


def _refuse_delimiter(line: str, delimiter: str, where: str) -> None:
    if delimiter in line:
        return
    for sign, plural in _DELIMITERS.items():
        if sign in line:
            raise DataError(f"the columns are separated by {plural}", where, f"separate them by commas or {_IMPORT}")


def _check_header(header: tuple[str, ...], where: str) -> None:
    if header and all(number(h) is not None for h in header):
        raise DataError("there is no header line", where, "name the columns with their units, deflection_mm,force_N")
    repeated = sorted({h for h in header if h and header.count(h) > 1})
    if repeated:
        raise DataError(f'the column "{repeated[0]}" stands there twice', where, "remove or rename one")


def _check_width(cells: tuple[str, ...], header: tuple[str, ...], where: str, decimal: str) -> None:
    extra = cells[len(header) :]
    if not any(extra):
        return
    counts = f"the line has {len(cells)} cells and the header {len(header)}"
    if decimal == "." and len(cells) == 2 * len(header) and all(c.lstrip("+-").isdecimal() for c in cells):
        fault = f"{counts}, as decimal commas would cause"
        raise DataError(fault, where, f"write decimal points, or semicolons between the cells and {_IMPORT}")
    raise DataError(counts, where, "correct the line")


def _example(name: str, quantity: str) -> str:
    usual = {"time": "s", "length": "mm", "force": "N", "stress": "MPa", "speed": "mm_per_min"}.get(quantity, "")
    return f"{name}_{usual}".rstrip("_")
