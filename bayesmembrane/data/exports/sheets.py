"""From the bytes of a file to rows of cells: encoding, what separates cells, the decimal sign, sheets of workbooks."""

from __future__ import annotations

import csv
import datetime
import io
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from bayesmembrane.data.exports.cells import POINT, Cell, Marks, evidence, like_number
from bayesmembrane.data.exports.hints import Guess, Hints
from bayesmembrane.data.exports.words import fact_of, named, reading_of, unit_of
from bayesmembrane.ground.errors import DataError, SettingsError

BOMS = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
ENCODINGS = ("cp1252", "cp1250", "gb18030", "iso8859-2", "shift_jis")
DELIMITERS = {"tab": "\t", "semicolon": ";", "comma": ",", "bar": "|", "space": " "}
DECIMALS = {"point": ".", "comma": ","}
WORKBOOK = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")
MOST_BYTES = 500_000_000
QUOTED = 12
"""Lines that a quoted name may take, at most, with its neighbours."""
NO_SIGN = "no number has a sign"
HEAD, SAMPLE = 400, 400
"""Lines from the beginning, and lines evenly from the rest, on which delimiter and decimal sign are decided."""


@dataclass(frozen=True)
class Sheet:
    """Rows of cells.

    Attributes
    ----------
    file, name : what errors call the file; the sheet's name, "" in a text file
    lines : line (or row) numbers of the rows that are not blank
    raw : what stands there: text to be split, or the cells
    delimiter, marks : how cells are separated and how numbers are written as text
    guesses : what was guessed of these
    doubt : what to raise where a reading is taken from text, for the decimal sign is open
    """

    file: str
    name: str
    lines: Sequence[int]
    raw: Sequence[str | Sequence[Cell]]
    delimiter: str = ","
    marks: Marks = POINT
    guesses: tuple[Guess, ...] = ()
    doubt: DataError | None = None

    def __len__(self) -> int:
        """The number of rows."""
        return len(self.raw)

    def cells(self, row: int) -> Sequence[Cell]:
        """The cells of a row, stripped of blanks."""
        raw = self.raw[row]
        return split(raw, self.delimiter) if isinstance(raw, str) else raw

    def place(self, row: int) -> str:
        """File, sheet and line of a row, for errors."""
        return f"{self.file}, {self.line(row)}"

    def line(self, row: int) -> str:
        """The same without the file."""
        sheet = f"sheet {self.name}, " if self.name else ""
        return f"{sheet}line {self.lines[min(row, len(self.lines) - 1)]}"


def is_workbook(data: bytes) -> bool:
    """True for the container of xlsx, ods and xls files."""
    return data.startswith(WORKBOOK)


def is_text(data: bytes) -> bool:
    """False for what has zero bytes that no encoding explains."""
    return b"\0" not in data or data.startswith((b"\xff\xfe", b"\xfe\xff")) or bool(_wide(data))


def _wide(data: bytes) -> str:
    """The encoding of two bytes a letter that a file without a mark has, "" if it is none."""
    head = data[:4000]
    for name, first in (("utf-16-le", 1), ("utf-16-be", 0)):
        if head[first::2].count(0) > 0.7 * len(head[first::2]) and head[1 - first :: 2].count(0) == 0:
            return name
    return ""


def text_sheet(data: bytes, file: str, hints: Hints) -> Sheet:
    """The one sheet of a text file; raises `DataError` where it cannot be told."""
    text, encoding = decoded(data, file, hints)
    numbered = [(k, line) for k, line in _all_lines(text) if line.strip(' \t,;"')]
    if not numbered:
        raise DataError("the file is empty", file, "export the measurement again")
    lines, raw = [k for k, _ in numbered], [t for _, t in numbered]
    delimiter, why = _delimiter(raw, hints)
    sheet = Sheet(file, "", lines, raw, delimiter)
    marks, reason = _marks(sheet, hints)
    shown = next((k for k, v in DELIMITERS.items() if v == delimiter), delimiter)
    guesses = (encoding, Guess("delimiter", shown, why, "--delimiter"), _decimal(marks, reason))
    return replace(sheet, marks=marks, guesses=guesses)


def _decimal(marks: Marks, why: str) -> Guess:
    return Guess("decimal sign", "comma" if marks.decimal == "," else "point", why, "--decimal")


def workbook_sheets(data: bytes, file: str, hints: Hints) -> list[Sheet]:
    """The sheets of a workbook; raises `DataError` if it is damaged."""
    from python_calamine import CalamineError, CalamineWorkbook

    try:
        book = CalamineWorkbook.from_filelike(io.BytesIO(data))
        found = [(name, book.get_sheet_by_name(name).to_python(skip_empty_area=False)) for name in book.sheet_names]
    except (CalamineError, ValueError, OSError, KeyError, MemoryError) as error:
        reason = " ".join(str(error).split())[:120]
        raise DataError(f"the workbook cannot be opened ({reason})", file, "save it again as xlsx or as text") from None
    return [_sheet_of(file, name, rows, hints) for name, rows in found]


def _sheet_of(file: str, name: str, rows: Sequence[Sequence[object]], hints: Hints) -> Sheet:
    """A sheet with the decimal sign of the numbers that it holds as text; nothing is told where there are none."""
    kept = [(k, [_cell(c) for c in row]) for k, row in enumerate(rows, 1) if any(c != "" for c in row)]
    sheet = Sheet(file, name, [k for k, _ in kept], [r for _, r in kept])
    try:
        marks, why = _marks(sheet, hints)
    except DataError as error:
        return replace(sheet, doubt=error)
    return sheet if why == NO_SIGN else replace(sheet, marks=marks, guesses=(_decimal(marks, why),))


def _cell(value: object) -> Cell:
    """A cell of a workbook: numbers as they are, all else as text."""
    if isinstance(value, bool):
        return str(value)
    if isinstance(value, int | float):
        return float(value)
    if isinstance(value, datetime.timedelta):
        return value.total_seconds()
    return str(value).strip()


def split(line: str, delimiter: str) -> list[str]:
    """The cells of a line; quotes protect what they enclose."""
    if delimiter == " ":
        return line.split()
    if '"' in line:
        try:
            return [c.strip() for c in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))]
        except (csv.Error, StopIteration):
            pass  # a field beyond the limit of csv: taken as it stands, and refused where it is read
    return [c.strip() for c in line.split(delimiter)]


# ---- text ------------------------------------------------------------------------------------------------------------


def decoded(data: bytes, file: str, hints: Hints) -> tuple[str, Guess]:
    """The text of a file, and in which encoding it was read; raises `DataError` if it is no text."""
    if len(data) > MOST_BYTES:
        raise DataError(f"the file has {len(data) / 1e6:.0f} MB", file, "export fewer readings")
    if hints.encoding:
        return _decode(data, hints.encoding, file), Guess("encoding", hints.encoding, "it was said", "--encoding")
    for bom, name in BOMS.items():
        if data.startswith(bom):
            return _decode(data, name, file), Guess("encoding", name, "the file begins with its mark", "--encoding")
    if b"\0" in data:
        return _decode_wide(data, file)
    try:
        why = "all bytes are ASCII" if data.isascii() else "the bytes are valid UTF-8"
        return data.decode("utf-8"), Guess("encoding", "utf-8", why, "--encoding")
    except UnicodeDecodeError:
        name, why = _eight_bits(data)
        return _decode(data, name, file), Guess("encoding", name, why, "--encoding")


def guessed_encoding(data: bytes, hints: Hints) -> str:
    """The encoding of one or two bytes a letter in which a file is read by its words alone; "" if more tells it."""
    if hints.encoding or is_workbook(data) or b"\0" in data or data.startswith(tuple(BOMS)):
        return ""
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return _eight_bits(data)[0]
    return ""


def _decode(data: bytes, encoding: str, file: str) -> str:
    try:
        return data.decode(encoding)
    except LookupError:
        raise SettingsError(f'there is no encoding "{encoding}"', remedy="try utf-8, cp1252, cp1250 or gbk") from None
    except (UnicodeError, ValueError) as error:
        start = getattr(error, "start", 0)
        line = data.count(b"\n", 0, start) + 1
        raise DataError(f"the text is not {encoding}", f"{file}, line {line}", "say --encoding") from None


def _decode_wide(data: bytes, file: str) -> tuple[str, Guess]:
    name = _wide(data)
    if name:
        return _decode(data, name, file), Guess("encoding", name, "every other byte is zero", "--encoding")
    raise DataError(
        "this is not a text file",
        file,
        "export the readings as text or as a workbook (xlsx); machines' own formats stay closed",
    )


def _eight_bits(data: bytes) -> tuple[str, str]:
    """The encoding of one or two bytes a letter in which most words of the file are words, and why."""
    lines = [line for line in re.split(rb"[\r\n]+", data)[:HEAD] if not line.isascii()]
    lines = lines or [line for line in re.split(rb"[\r\n]+", data) if not line.isascii()][:HEAD]
    texts = {}
    for name in ENCODINGS:
        try:
            texts[name] = [line.decode(name) for line in lines]
        except UnicodeError:
            continue
    if not texts:
        return "latin-1", "nothing else fits its bytes"
    scores = {name: sum(_sense(line) for line in text) for name, text in texts.items()}
    best = [name for name, score in scores.items() if score == max(scores.values())]
    equal = [name for k, name in enumerate(best) if texts[name] not in [texts[other] for other in best[:k]]]
    if len(equal) > 1:
        chosen = _normalizers_choice(data, equal)
        return chosen, f"it is not UTF-8, and its words read as well in {' and '.join(equal)}"
    return equal[0], "it is not UTF-8, and its words make the most sense so"


def _normalizers_choice(data: bytes, equal: list[str]) -> str:
    from charset_normalizer import from_bytes

    found = from_bytes(data[:20_000], cp_isolation=equal).best()
    name = found.encoding.replace("_", "-") if found is not None else ""
    return next((e for e in equal if e.replace("_", "-") == name), equal[0])


_LONE = re.compile("(?<![\u2e80-\uffff])[\u2e80-\uffff](?![\u2e80-\uffff])")
"""A letter of the East between letters of the West, as two bytes of the West make it: ``µm`` and ``°C``."""


def _is_common(letter: str) -> bool:
    """Whether a letter of the East is one that also stands alone: 力, and not 祄."""
    try:
        return bool(letter.encode("gb2312"))
    except UnicodeEncodeError:
        return False


def _sense(line: str) -> int:
    """How many cells of a line are words of a machine or known units, less what is no word of any language."""
    score = 0
    for cell in re.split(r'[\t;,"|]+', line):
        if cell.isascii():
            continue
        name = named(cell)
        score += 4 * bool(reading_of(name.name).role or fact_of(cell) or fact_of(name.name))
        score += 2 * any(unit_of(text) for text in (name.unit, cell) if not text.isascii())
        score -= sum(not _is_common(letter) for letter in _LONE.findall(cell))
        score -= sum(1 for a, b in zip(cell, cell[1:] + " ", strict=True) if _odd(a, b))
    return score


def _odd(a: str, b: str) -> bool:
    if ord(a) < 128 and ord(b) < 128:
        return False
    wide = [ord(c) > 0x2E7F for c in (a, b)]
    latin = [c.isascii() and c.isalpha() for c in (a, b)]
    if (wide[0] and latin[1]) or (latin[0] and wide[1]):
        return True
    # Signs inside words, and letters of no European language between Latin ones.
    strange = [ord(c) > 127 and not c.isalpha() and c not in "°²³µ€–—·" for c in (a, b)]
    raised = a in "²³°" and b.isalpha() and a + b not in ("°C", "°F")
    inside = raised or (strange[0] and b.isalpha()) or (a.isalpha() and strange[1])
    return inside or 0x80 <= ord(a) < 0xA0


def _all_lines(text: str) -> Iterator[tuple[int, str]]:
    """(line number, line); a quoted cell may hold line ends, as headers of workbooks do."""
    open_: list[tuple[int, str]] = []
    for k, line in enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), 1):
        odd = line.count('"') % 2 == 1
        if not open_ and not (odd and not any(like_number(c) for c in re.split(r"[;\t, ]", line))):
            yield k, line
            continue
        open_.append((k, line))
        if len(open_) > 1 and odd:
            yield open_[0][0], " ".join(part for _, part in open_)
            open_ = []
        elif len(open_) > QUOTED:  # a quote that nothing ends is a sign like any other
            yield from open_
            open_ = []
    yield from open_


# ---- delimiter and decimal sign --------------------------------------------------------------------------------------


def _sample(raw: Sequence[str]) -> list[str]:
    rest = raw[HEAD:]
    step = max(len(rest) // SAMPLE, 1)
    return [*raw[:HEAD], *rest[::step]]


def _delimiter(raw: Sequence[str], hints: Hints) -> tuple[str, str]:
    if hints.delimiter:
        return DELIMITERS.get(hints.delimiter, hints.delimiter), "it was said"
    sample = _sample(raw)
    widths: dict[str, tuple[int, int]] = {}
    for sign in DELIMITERS.values():
        counts = Counter(w for line in sample if (w := _numeric_width(split(line, sign))) >= 2)
        if counts:
            width, rows = max(counts.items(), key=lambda item: (item[1], item[0]))
            widths[sign] = (rows, width)
    if not widths:
        return next((s for s in DELIMITERS.values() if sum(s in line for line in sample) > 0.5 * len(sample)), ","), (
            "it is the sign that most lines have"
        )
    best = max(widths, key=lambda s: (widths[s][0], s != " ", -list(DELIMITERS.values()).index(s)))
    rows, width = widths[best]
    return best, f"so split, {rows} of {len(sample)} lines looked at have {width} numbers"


def _numeric_width(cells: Sequence[str]) -> int:
    """How many cells are numbers, 0 if most are something else."""
    full = [c for c in cells if c]
    numbers = sum(like_number(c) for c in full)
    return numbers if numbers > 0.5 * len(full) else 0


def _marks(sheet: Sheet, hints: Hints) -> tuple[Marks, str]:
    if hints.decimal:
        return Marks(DECIMALS[hints.decimal]), "it was said"
    found: dict[str, tuple[str, str]] = {}
    counts: Counter[str] = Counter()
    unclear = ""
    step = max((len(sheet) - HEAD) // SAMPLE, 1)
    for row in [*range(min(HEAD, len(sheet))), *range(HEAD, len(sheet), step)]:
        numbers = [c for c in sheet.cells(row) if like_number(c)]
        if len(numbers) < 2:
            continue
        cells = [c for c in numbers if isinstance(c, str)]
        signs, doubtful = evidence(cells)
        for sign, cell in signs.items():
            found.setdefault(sign, (cell, sheet.line(row)))
            counts[sign] += 1
        if doubtful and not unclear:
            unclear = next(c for c in cells if evidence([c])[1])
    if len(found) == 2:
        (sign, n), (other, m) = counts.most_common(2)
        if m > 0.02 * n or n < 20:
            (a, k), (b, j) = found[sign], found[other]
            fault = f'"{b}" has another decimal sign than the numbers before it ("{a}" in {k})'
            raise DataError(fault, f"{sheet.file}, {j}", "write all numbers with one sign, or say --decimal")
        return Marks(sign), f'"{found[sign][0]}" in {found[sign][1]} can be read in no other way'
    if found:
        ((sign, (cell, line)),) = found.items()
        return Marks(sign), f'"{cell}" in {line} can be read in no other way'
    if unclear:
        raise DataError(
            f'"{unclear}" may have decimals or thousands, and no number of the file says which',
            sheet.file,
            "say --decimal point or --decimal comma",
        )
    return Marks(), NO_SIGN
