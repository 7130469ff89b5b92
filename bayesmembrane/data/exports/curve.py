"""From the columns of an export to the curve of a rig: which specimen, zero, sign, strain and stress; each guess said."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bayesmembrane.data.exports.blocks import Block, Fact, blocks_of, facts_of, name_in
from bayesmembrane.data.exports.columns import (
    EXAMPLE,
    Candidate,
    Read,
    best,
    candidates,
    guess_of,
    has_curve,
    read,
    trimmed,
)
from bayesmembrane.data.exports.film import Film, film_of
from bayesmembrane.data.exports.hints import Guess, Hints
from bayesmembrane.data.exports.relations import (
    apart,
    gauge_length_behind,
    jumps,
    logarithmic_length_behind,
    speed_against,
)
from bayesmembrane.data.exports.sheets import Sheet
from bayesmembrane.data.exports.words import COMPRESSION, CYCLE, STRAIN, STRETCH, TRAVEL, plain
from bayesmembrane.data.motion import check_order, holds, legs
from bayesmembrane.data.thinning import kept_rows
from bayesmembrane.ground.errors import DataError, SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.units import FORCE, STRESS, TIME

STRIPS = ("uniaxial", "equibiaxial", "planar")
RESTS = 0.02
"""A force below this part of the largest counts as none: the film is at rest there."""
_CYCLE = re.compile(r"(?P<number>\d{1,6})(?:[-_ ]+(?P<word>[A-Za-z]+))?")
_WAYS = {
    1: ("stretch", "load", "up", "belast"),
    -1: ("recover", "unload", "down", "release", "entlast"),
    0: ("hold", "rest"),
}
NEAR = 0.05
"""A travel that starts within this part of its range starts near zero."""


@dataclass(eq=False)
class Export:
    """An export while it is being read: what was found, and all that is said about it on the way."""

    file: str
    hints: Hints
    block: Block
    found: list[Candidate]
    rows: Sequence[int] = ()
    guesses: list[Guess] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    contradictions: list[str] = field(default_factory=list)
    used: set[int] = field(default_factory=set)
    lengths: list[Fact] = field(default_factory=list)
    length: float | None = None

    def column(self, role: str, kind: str | None = None) -> Read | None:
        """The values of a role in SI, None if the export has none."""
        chosen = best(self.found, role, self.block, kind)
        if chosen is None:
            return None
        if chosen.column.index not in self.used:
            self.used.add(chosen.column.index)
            self.guesses += guess_of(role, chosen, self.hints)
        return read(self.block, chosen, self.rows, self.hints)

    @property
    def lines(self) -> list[int]:
        """(N,) line numbers of the rows."""
        return [self.block.sheet.lines[r] for r in self.rows]

    def contradict(self, sentence: str) -> None:
        """Keep a sentence about a contradiction, unless it is ""."""
        if sentence:
            self.contradictions.append(sentence)

    def guess(self, what: str, value: str, why: str, option: str = "") -> None:
        """Keep a guess."""
        self.guesses.append(Guess(what, value, why, option))


@dataclass(frozen=True)
class Curve:
    """What an export says, in SI: the columns of a rig's curve, the film, and how it was understood."""

    columns: Mapping[str, Array]
    film: Film
    rig: str
    lines: Sequence[int]
    guesses: Sequence[Guess]
    contradictions: Sequence[str]
    notes: Sequence[str]


def curve_of(sheets: Sequence[Sheet], file: str, hints: Hints, guesses: Sequence[Guess] = ()) -> Curve:
    """The curve in the sheets of a file; raises `DataError` or `SettingsError` where it cannot be read with confidence."""
    block, found, blocks = _part(sheets, file, hints)
    export = Export(file, hints, block, found, guesses=list(guesses))
    if len(sheets) > 1:
        export.guess("sheet", block.sheet.name, "it has the readings", "--sheet")
    facts, remarks, name = _facts(sheets, blocks, block)
    film = film_of(facts, hints, name, export, grips=not {c.role for c in found} & {STRAIN, STRETCH})
    export.lengths = [f for f in facts if f.name in ("gauge_length", "grip_length")]
    export.notes += remarks
    export.rows = trimmed(block, found)
    if len(export.rows) < 2:
        raise DataError(f"a curve needs at least two points, and this one has {len(export.rows)}", block.place)
    time = _time(export)
    strip = _is_strip(export, film)
    columns = _strip(export, film, time) if strip else _plain(export, film, time)
    _refuse_nonsense(export, columns)
    _checked_order(export, columns)
    for what in ("force", "nominal_stress", "deflection", "stretch"):
        if what in columns:
            export.contradict(jumps(what.replace("_", " "), columns[what], export.lines))
    ignored = [c.header for c in block.columns if c.header and c.index not in export.used]
    if ignored:
        export.notes.append(f"ignored columns: {', '.join(ignored)}")
    rig = hints.rig or ("uniaxial" if strip else "")
    film = replace(film, length=film.length or export.length)
    columns = _thinned(export, columns)
    return Curve(columns, film, rig, export.lines, export.guesses, export.contradictions, export.notes)


# ---- which block -----------------------------------------------------------------------------------------------------


def _part(sheets: Sequence[Sheet], file: str, hints: Hints) -> tuple[Block, list[Candidate], list[Block]]:
    if hints.sheet:
        sheets = [s for s in sheets if s.name == hints.sheet] or _no_sheet(sheets, hints.sheet)
    blocks = [block for sheet in sheets for block in blocks_of(sheet)]
    blocks_with_rows = [b for b in blocks if len(b.rows) >= 2]
    if not blocks_with_rows:
        line = f", line {sheets[0].lines[0]}" if sheets and len(sheets[0]) else ""
        fault = "no two lines with at least two numbers follow each other"
        raise DataError(fault, f"{file}{line}", "export the readings, not only the results; or say --delimiter")
    largest = max(blocks_with_rows, key=lambda b: len(b.rows))
    judged = [(b, _judged(b, hints, b is largest)) for b in blocks_with_rows]
    parts = [(b, c) for b, c in judged if has_curve(c) and len(b.rows) >= 0.02 * len(largest.rows)]
    if not parts or len(largest.rows) > 5 * max(len(b.rows) for b, _ in parts):
        _refuse_columns(largest, hints)
    if len(parts) > 1:
        return *_chosen(parts, file, hints), blocks
    return *parts[0], blocks


def _judged(block: Block, hints: Hints, largest: bool) -> list[Candidate]:
    """Candidates; ``--columns`` is about the blocks that it fits."""
    if not hints.columns:
        return candidates(block, hints)
    try:
        return candidates(block, hints)
    except SettingsError:
        if largest:
            raise
        return []


def _chosen(parts: list[tuple[Block, list[Candidate]]], file: str, hints: Hints) -> tuple[Block, list[Candidate]]:
    labels = _labels([b for b, _ in parts])
    if hints.part:
        for k, label in enumerate(labels, 1):
            if hints.part in (str(k), label):
                return parts[k - 1]
    shown = ", ".join(f"{k}: {label}" for k, label in enumerate(labels[:20], 1))
    fault = f'there is no part "{hints.part}"' if hints.part else f"the file has {len(parts)} sets of readings"
    raise DataError(f"{fault} ({shown})", file, "say which, --part 1 or its name")


def _labels(blocks: list[Block]) -> list[str]:
    labels = [b.label or b.sheet.name or f"line {b.sheet.lines[b.rows[0]]}" for b in blocks]
    if len(set(labels)) == len(labels):
        return labels
    return [f"{label}, line {b.sheet.lines[b.rows[0]]}" for label, b in zip(labels, blocks, strict=True)]


def _no_sheet(sheets: Sequence[Sheet], name: str) -> Any:
    raise SettingsError(f'there is no sheet "{name}"', remedy=f"known: {', '.join(s.name for s in sheets)}")


def _refuse_columns(block: Block, hints: Hints) -> None:
    names = [c.header for c in block.columns if c.header]
    n = len(block.columns)
    if not names:
        fault = f"nothing above the {n} columns of numbers names them"
        raise DataError(fault, block.place, f"name them in their order, {EXAMPLE}, with - for one that is not needed")
    found = candidates(block, hints)
    roles = {c.role for c in found}
    missing = "how far the film was pulled" if roles & {FORCE, STRESS} else "the force or stress"
    missing = missing if roles & {FORCE, STRESS, TRAVEL, STRAIN, STRETCH} else "travel and force"
    shown = ", ".join(names[:12])
    raise DataError(f"no column is known to hold {missing} among {shown}", block.place, f"name them, {EXAMPLE}")


def _facts(sheets: Sequence[Sheet], blocks: Sequence[Block], block: Block) -> tuple[list[Fact], list[str], str]:
    facts: list[Fact] = []
    remarks: list[str] = []
    name = ""
    label = block.label or block.sheet.name
    for sheet in sorted(sheets, key=lambda s: s is not block.sheet):
        used = {r for b in blocks if b.sheet is sheet and len(b.rows) > 1 and b.header is not None for r in b.rows}
        used |= set(block.rows) if sheet is block.sheet else set()
        more, said = facts_of(sheet, used, label)
        facts += more
        remarks += said
        name = name or name_in(sheet, used)
    return facts, remarks, block.label if not name and block.label and "column" not in block.label else name


def _is_strip(export: Export, film: Film) -> bool:
    """Whether the curve is one of stretch and nominal stress; a guess unless the rig was said."""
    rig, roles = export.hints.rig, {c.role for c in export.found}
    if rig:
        return _homogeneous(rig)
    if {TRAVEL, FORCE} <= roles:
        sizes = {"--width-mm": film.width, "--thickness-um": film.thickness}
        if not roles & {STRAIN, STRETCH}:
            sizes["--gauge-length-mm"] = film.length
        missing = [option for option, size in sizes.items() if not size]
        if missing:
            why = f"the file does not say it; a strip needs --rig uniaxial {' '.join(missing)}"
            export.guess("rig", "none yet, the curve is deflection and force", why, "--rig")
            return False
    why = "the file has strain or stress" if roles & {STRAIN, STRETCH, STRESS} else "the file has length and width"
    export.guess("rig", "uniaxial", why, "--rig")
    return True


def _homogeneous(rig: str) -> bool:
    from bayesmembrane.ground.registry import component

    if rig == "biaxial":
        raise SettingsError(
            "a biaxial test has two forces", remedy="bring stretch_1, stretch_2 and both stresses as CSV"
        )
    return bool(component("rigs", rig).homogeneous)


# ---- time ------------------------------------------------------------------------------------------------------------


def _time(export: Export) -> Array | None:
    """(N,) s, or None; readings that bear the time of the one before are left aside."""
    rate = export.hints.readings_per_s
    if rate is not None:
        export.guess("time", f"{rate:g} readings a second", "it was said", "--readings-per-s")
        return np.arange(len(export.rows)) / rate
    found = export.column(TIME)
    if found is None:
        return None
    step = np.diff(found.values)
    if np.any(step < 0):
        k = 1 + int(np.argmax(step < 0))
        fault = f"the time falls ({found.values[k]:g} s after {found.values[k - 1]:g} s)"
        where = export.block.sheet.place(export.rows[k])
        raise DataError(
            fault, where, "keep one test only; or leave the times aside with --columns and --readings-per-s"
        )
    same = np.append(False, step == 0)
    if np.mean(same) > 0.5:
        fault = f"{np.sum(same)} of {same.size} readings bear the time of the one before"
        raise DataError(fault, export.block.place, "leave the times aside with --columns, and say --readings-per-s")
    if np.any(same):
        lines = np.array(export.lines)[same]
        export.notes.append(
            f"{lines.size} readings that bear the time of the one before are left aside (lines {lines[0]} to {lines[-1]})"
        )
    export.rows = [r for r, again in zip(export.rows, same, strict=True) if not again]
    return found.values[~same]


def _checked_order(export: Export, columns: Mapping[str, Array]) -> None:
    """Raise `DataError` where readings without times cannot be in the order of a test."""
    if TIME in columns:
        return
    travel = columns.get("deflection", columns.get("stretch"))
    assert travel is not None
    try:
        check_order(travel, [export.block.sheet.place(r) for r in export.rows])
    except DataError as error:
        remedy = (
            f"say how often it was read, --readings-per-s 10, if this is the order of the test; else {error.remedy}"
        )
        raise DataError(
            error.what.replace("mm", "") if "stretch" in columns else error.what, error.where, remedy
        ) from None


# ---- travel and force ------------------------------------------------------------------------------------------------


def _need(export: Export, role: str) -> Read:
    found = export.column(role)
    if found is None:
        shown = ", ".join(c.header for c in export.block.columns if c.header)
        raise DataError(f"there is no column of {role} among {shown}", export.block.place, f"name it, {EXAMPLE}")
    return found


def _plain(export: Export, film: Film, time: Array | None) -> dict[str, Array]:
    """Deflection and force, positive for a lifted disc."""
    travel, force = _need(export, TRAVEL), _need(export, FORCE)
    x, f = _signs(export, travel.values, force.values, free=True)
    x = _zeroed(export, travel, x, f)
    f = _zeroed_force(export, f)
    _against_speed(export, film, x, time)
    return _with(export, time, {"deflection": x, "force": f})


def _strip(export: Export, film: Film, time: Array | None) -> dict[str, Array]:
    """Stretch, and nominal stress in Pa."""
    force = export.column(FORCE)
    stress, true = export.column(STRESS, "|engineering"), export.column(STRESS, "true")
    stretch, travel = _stretch(export, film, force or stress or true)
    nominal = _nominal(export, film, (force, stress, true), stretch)
    if np.any(stretch <= 0):
        k = int(np.argmin(stretch))
        fault = f"a stretch of {stretch[k]:g} cannot be"
        raise DataError(fault, export.block.sheet.place(export.rows[k]), "check --gauge-length-mm, --zero and --strain")
    if travel is not None:
        _against_speed(export, film, travel, time)
    return _with(export, time, {"stretch": stretch, "nominal_stress": nominal})


def _with(export: Export, time: Array | None, columns: dict[str, Array]) -> dict[str, Array]:
    columns = {**columns, **_said_phases(export)}
    return columns if time is None else {TIME: time, **columns}


def _said_phases(export: Export) -> dict[str, Array]:
    """``cycle`` and ``direction``, (N,), as a column of the machine says them: 1, 2 or 1-Stretch, 1-Recover."""
    chosen = best(export.found, CYCLE, export.block)
    if chosen is None:
        return {}
    cells = [export.block.sheet.cells(r)[chosen.column.index : chosen.column.index + 1] for r in export.rows]
    said = [_CYCLE.fullmatch(f"{c[0]:g}" if isinstance(c[0], float) else c[0]) if c else None for c in cells]
    number = np.array([float(s["number"]) if s else np.nan for s in said])
    header = f'"{chosen.column.header}"'
    if not np.all(np.diff(number) >= 0):
        export.notes.append(f"{header} does not count cycles in their order and is not used")
        return {}
    export.used.add(chosen.column.index)
    found = {"cycle": 1.0 + number - number[0]}
    ways = [_way(s["word"] if s else "") for s in said]
    if ways[0] and None not in ways:
        found["direction"] = np.array([float(w) for w in _carried_on([w or 0 for w in ways])])
    export.guess(" and ".join(found), f"as {header} says", "it counts them", "--columns")
    return found


def _way(word: str | None) -> int | None:
    """1 for words of loading, -1 of unloading, 0 of standing, None for any other."""
    low = (word or "").lower()
    return next((way for way, words in _WAYS.items() if low.startswith(words)), None)


def _carried_on(ways: Sequence[int]) -> list[int]:
    """The direction of each reading; a hold belongs to the leg before it."""
    out: list[int] = []
    for way in ways:
        out.append(way or out[-1])
    return out


def _thinned(export: Export, columns: dict[str, Array]) -> dict[str, Array]:
    """As many readings as were asked for, with all turning points."""
    most, travel = export.hints.readings, columns.get("deflection", columns.get("stretch"))
    if most is None or travel is None or travel.size <= most:
        return columns
    rows = kept_rows(legs(travel), holds(travel), most)
    why = "so many were asked for; they lie evenly along the test, with all turning points and ends of holds"
    export.guess("readings", f"{rows.size} of {travel.size}", why, "--readings")
    return {name: values[rows] for name, values in columns.items()}


def _signs(export: Export, x: Array, f: Array, free: bool) -> tuple[Array, Array]:
    """Travel and force so that both are positive where the film is pulled; ``free``: a push is a pull from below."""
    said = export.hints.sign
    flips = {"keep": (1, 1), "flip": (-1, -1), "flip-force": (1, -1), "flip-travel": (-1, 1)}
    if said:
        export.guess("sign", said, "it was said", "--sign")
        return flips[said][0] * x, flips[said][1] * f
    at = int(np.argmax(np.abs(f)))
    back, pushed = bool(x[at] < x[0]), bool(f[at] < 0)
    if not back and not pushed:
        return x, f
    if not free:
        if back != pushed:
            which = (
                "force is negative and the travel goes on" if pushed else "travel goes back and the force is positive"
            )
            fault = f"where most is carried the {which}"
            raise DataError(fault, export.block.place, "say --sign flip-force or flip-travel (pulled), or flip or keep")
        export.guess("sign", "kept", "travel and force are negative, as in compression", "--sign")
        return x, f
    words = {(True, True): "travel and force are", (True, False): "the travel is", (False, True): "the force is"}
    why = f"{words[back, pushed]} negative where most is carried, and a lifted disc has both positive"
    turned = "both" if back and pushed else "travel" if back else "force"
    export.guess("sign", f"{turned} turned round", why, "--sign")
    return (-x if back else x), (-f if pushed else f)


def _zeroed(export: Export, travel: Read, x: Array, f: Array) -> Array:
    """The travel from where the film was at rest."""
    said, start, reach = export.hints.zero, float(x[0]), float(np.ptp(x))
    if said and "travel" not in said:
        export.guess("zero of the travel", "as the file has it", "it was said", "--zero")
        return x
    if said:
        export.guess("zero of the travel", f"{1e3 * start:.6g} mm", "it was said: where it starts", "--zero")
        return x - start
    if abs(start) <= NEAR * reach:
        if start:
            where = f"as the file has it, it starts at {1e3 * start:.4g} mm"
            export.guess("zero of the travel", where, "that is near zero", "--zero")
        return x
    absolute = any(c.reading.absolute for c in export.found if c.column.index == travel.column.index)
    rests = abs(float(f[0])) <= RESTS * float(np.max(np.abs(f)))
    if absolute or rests or abs(start) > reach:
        why = (
            "its name says that it is a position"
            if absolute
            else "the film carries nothing there"
            if rests
            else "it starts farther from zero than it goes"
        )
        export.guess("zero of the travel", f"{1e3 * start:.6g} mm, where it starts", why, "--zero")
        return x - start
    fault = f"the travel starts at {1e3 * start:.4g} mm under {100 * abs(f[0]) / np.max(np.abs(f)):.3g} % of the largest load"
    raise DataError(
        fault,
        export.block.sheet.place(export.rows[0]),
        "say --zero none if it counts from rest, --zero travel if it starts there",
    )


def _zeroed_force(export: Export, f: Array) -> Array:
    said, start = export.hints.zero, float(f[0])
    if "force" in said:
        export.guess("zero of the force", f"{start:.4g} N", "it was said: where it starts", "--zero")
        return f - start
    if abs(start) > 0.01 * float(np.max(np.abs(f))):
        share = f"{100 * abs(start) / float(np.max(np.abs(f))):.2g} % of the largest"
        export.guess(
            "zero of the force", "as the file has it", f"its start at {share} may be a preload", "--zero force"
        )
    return f


def _against_speed(export: Export, film: Film, travel: Array, time: Array | None) -> None:
    if time is not None and film.speed:
        export.contradict(speed_against(travel, time, film.speed, export.lines))


# ---- stretch and nominal stress --------------------------------------------------------------------------------------


def _stretch(export: Export, film: Film, load: Read | None) -> tuple[Array, Array | None]:
    """(stretch (N,), travel (N,) m or None): by the gauge length if it was said, else as the file has it."""
    roles = {c.role for c in export.found}
    travel = _travel(export, load) if TRAVEL in roles else None
    by_length = 1.0 + travel / film.length if travel is not None and film.length else None
    stated = _stated_stretch(export, travel) if roles & {STRAIN, STRETCH} else None
    if by_length is not None and (stated is None or export.hints.gauge_length):
        if stated is not None:
            export.contradict(
                apart("travel over gauge length and the file's own strain", by_length, stated, export.lines)
            )
        export.guess(
            "stretch", "1 + travel / gauge length", f"the gauge length is {1e3 * (film.length or 0):g} mm", "--columns"
        )
        return by_length, travel
    if stated is None:
        fault = "the travel cannot become a stretch: the gauge length is not known"
        raise DataError(fault, export.block.place, "say --gauge-length-mm")
    if by_length is not None:
        export.contradict(apart("travel over gauge length and the file's own strain", by_length, stated, export.lines))
    return stated, travel


def _travel(export: Export, load: Read | None) -> Array:
    travel = _need(export, TRAVEL)
    f = load.values if load is not None else np.zeros(travel.values.size)
    x, _ = _signs(export, travel.values, f, free=False)
    return _zeroed(export, travel, x, f)


def _stated_stretch(export: Export, travel: Array | None) -> Array:
    """1 + e, exp(e) or l, as the file's column of strain or stretch says."""
    stretch = export.column(STRETCH)
    if stretch is not None:
        if abs(stretch.values[0]) < 0.3 and np.min(np.abs(stretch.values)) < 0.1:
            fault = (
                f'"{stretch.column.header}" is called a stretch and starts at {stretch.values[0]:g}, as a strain does'
            )
            raise DataError(fault, export.block.place, f'say what it is, --columns "strain={stretch.column.header}"')
        return stretch.values
    strain = _strain(export, travel)
    e, kind = strain.values, export.hints.strain or strain.kind
    name = f'"{strain.column.header}"'
    if kind == "stretch":
        export.guess("strain", f"{name} is a stretch", "it was said", "--strain")
        return e
    if not kind and float(np.min(e)) > 0.9 and abs(e[0] - 1) < 0.1:
        fault = f"{name} is called a strain and starts at {e[0]:g}, as a stretch does"
        raise DataError(fault, export.block.place, "say --strain stretch, or engineering if it is one")
    if "travel" in export.hints.zero:
        e = e - e[0]
    elif abs(e[0]) > 0.01 * float(np.ptp(e)):
        export.guess("zero of the strain", f"as the file has it, it starts at {e[0]:.4g}", "it is near", "--zero")
    if kind:
        why = "it was said" if export.hints.strain else "its name says so"
        export.guess("strain", f"{name} is {kind}", why, "--strain")
        return np.exp(e) if kind == "true" else 1.0 + e
    return _unnamed_strain(export, name, e, travel)


def _unnamed_strain(export: Export, name: str, e: Array, travel: Array | None) -> Array:
    """A strain that does not say whether it is engineering or true: asked of the travel, if there is one."""
    why = "machines write change of length over length at rest, and the file does not say"
    if travel is not None:
        (length, linear), (other, logarithmic) = gauge_length_behind(travel, e), logarithmic_length_behind(travel, e)
        if linear < 0.01:
            why = f"it is the travel over {1e3 * length:.5g} mm"
            export.length = float(f"{length:.6g}")
            _against_length(export, length)
        elif logarithmic < 0.01:
            export.guess("strain", f"{name} is true", f"it is ln(1 + travel / {1e3 * other:.5g} mm)", "--strain")
            return np.exp(e)
    export.guess("strain", f"{name} is engineering", why, "--strain")
    return 1.0 + e


def _against_length(export: Export, length: float) -> None:
    """A contradiction if the export states another length than the one that its strain is made with."""
    for fact in export.lengths:
        if abs(fact.value / length - 1) > 0.02:
            export.contradict(
                f'the strain is the travel over {1e3 * length:.5g} mm, and "{fact.words}" ({fact.place}) is not'
            )


def _strain(export: Export, travel: Array | None) -> Read:
    """The column of strain; its unit from the data if the file names none and the gauge length is known."""
    chosen = best(export.found, STRAIN, export.block)
    assert chosen is not None
    if not chosen.unit:
        bare = read(export.block, replace(chosen, unit="one"), export.rows, export.hints)
        largest = float(np.max(np.abs(bare.values)))
        unit = "percent" if largest > 15 else "one" if largest < 1.0 and export.hints.strain else ""
        if unit:
            why = f"the file names no unit, and its largest value is {largest:g}"
            export.guess("unit of the strain", unit, why, "--units strain=percent or 1")
            export.found = [c if c is not chosen else replace(chosen, unit=unit) for c in export.found]
    found = export.column(STRAIN)
    assert found is not None
    return found


def _nominal(export: Export, film: Film, loads: tuple[Read | None, Read | None, Read | None], stretch: Array) -> Array:
    """(N,) Pa: force over width and thickness at rest, or as the file has it."""
    force, stress, true = loads
    area = film.width * film.thickness if film.width and film.thickness else None
    by_force = force.values / area if force is not None and area else None
    kind = export.hints.stress or (stress.kind if stress is not None else "")
    if stress is not None and kind == "true":
        true, stress = stress, None
    if true is not None and stress is not None:
        export.contradict(
            apart(
                "true stress and engineering stress times stretch", true.values, stress.values * stretch, export.lines
            )
        )
    if stress is not None and by_force is not None:
        export.contradict(
            apart("stress and force over width and thickness (Pa)", stress.values, by_force, export.lines)
        )
    if by_force is not None and (stress is None or (export.hints.width and export.hints.thickness)):
        size = f"{1e3 * (film.width or 0):g} mm times {1e3 * (film.thickness or 0):g} mm"
        export.guess("nominal stress", "force / (width x thickness)", f"the specimen is {size}", "--columns")
        return by_force
    if stress is not None:
        return _as_nominal(export, stress, kind, force, stretch)
    if true is not None:
        export.guess(
            "nominal stress",
            f'"{true.column.header}" over the stretch',
            "it is true, of an incompressible film",
            "--stress",
        )
        return true.values / stretch
    missing = [o for o, v in (("--width-mm", film.width), ("--thickness-um", film.thickness)) if not v]
    fault = "the force cannot become a nominal stress: width and thickness of the film are not known"
    raise DataError(fault, export.block.place, f"say {' and '.join(missing)}, or --rig annulus if it is no strip")


def _as_nominal(export: Export, stress: Read, kind: str, force: Read | None, stretch: Array) -> Array:
    name = f'"{stress.column.header}"'
    if kind:
        export.guess(
            "stress", f"{name} is engineering", "it was said" if export.hints.stress else "its name says so", "--stress"
        )
        return stress.values
    why = "machines write force over area at rest, and the file does not say"
    if force is not None and np.ptp(stretch) > 0.05:
        area, scatter = _areas(force.values, stress.values)
        _, grown = _areas(force.values * stretch, stress.values)
        if grown < 0.2 * scatter and grown < 0.01:
            export.guess("stress", f"{name} is true", "it grows with force times stretch", "--stress")
            return stress.values / stretch
        if scatter < 0.01:
            why = f"it is the force over {1e6 * area:.4g} mm2"
    export.guess("stress", f"{name} is engineering", why, "--stress")
    return stress.values


def _areas(force: Array, stress: Array) -> tuple[float, float]:
    """(A in m^2, part of the range by which stress = force / A fails)."""
    product = float(np.dot(force, stress))
    if product <= 0 or not np.ptp(stress):
        return np.nan, np.inf
    area = float(np.dot(force, force)) / product
    return area, float(np.max(np.abs(force / area - stress)) / np.ptp(stress))


def _refuse_nonsense(export: Export, columns: Mapping[str, Array]) -> None:
    """Raise `DataError` where nothing moves, nothing is carried, or what was pressed gets longer."""
    for name, what in (
        ("deflection", "travel"),
        ("stretch", "stretch"),
        ("force", "force"),
        ("nominal_stress", "stress"),
    ):
        if name in columns and np.ptp(columns[name]) == 0:
            raise DataError(
                f"the {what} is the same in all rows", export.block.place, "check which column is which, --columns"
            )
    text = plain(
        " ".join(str(c) for r in range(min(20, len(export.block.sheet))) for c in export.block.sheet.cells(r)[:3])
    )
    pulls = columns.get("stretch")
    if pulls is not None and COMPRESSION.search(text) and float(np.max(pulls)) > 1.02 and not export.hints.sign:
        fault = "the file speaks of compression, and the film gets longer in it"
        raise DataError(fault, export.block.place, "say --sign flip if it was pressed, keep if it was pulled")
