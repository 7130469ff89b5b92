"""Exports of every layout, ways to damage them, and a judge of what comes out."""

from __future__ import annotations

import time
import traceback
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st

from bayesmembrane.data.exports.hints import Hints
from bayesmembrane.data.importers.base import Imported, Importer, recognising
from bayesmembrane.ground.errors import BayesmembraneError
from bayesmembrane.ground.registry import component, components
from tests.data.exports.test_layouts import FORCE, STRESS, STRETCH, TIME, TRAVEL, lines

MM, LONGEST = 1e3 * TRAVEL, 5.0
_HEAD = '"Results Table 1"\n"","Maximum Load","Extension at Break"\n"","(N)","(mm)"\n"1","0.51","20.0"\n\n"Raw Data"\n'
_ZWICK = '"Probendicke a0"\t0.5\t"mm"\n"Probenbreite b0"\t10\t"mm"\n"Messlänge"\t50\t"mm"\n'
_MTS = "MTS793|MPT|DEU|x|x|,|.|:|49|1|1|A\n\nDatenerfassung\t\tZeit:\t3,5\ts\n"
_SPANISH = """Deformación : Deformación por tracción (Extensión) distancia inicial,"50.00000",mm
Propiedades de la probeta : Anchura,"10.00000",mm
Propiedades de la probeta : Anchura final,"9.00000",mm
Propiedades de la probeta : Espesor,"0.50000",mm

"""
_SIZE = 0 * TIME + 50

FILES: dict[str, bytes] = {
    "csv_toml": lines("time_s;deflection_mm;force_N", TIME, MM, FORCE, sep=";", decimal=",").encode(),
    "delimited": lines("Czas [s];Wydłużenie [mm];Siła [N]", TIME, MM, FORCE, sep=";", decimal=",").encode("cp1250"),
    "delimited, strain": lines("Strain (%),Stress (MPa)", 100 * (STRETCH - 1), STRESS / 1e6).encode(),
    "delimited, Chinese": lines("时间(s)\t位移(mm)\t力(N)", TIME, MM, FORCE, sep="\t").encode("gbk"),
    "delimited, Spanish": lines(("Tiempo,Extensión,Carga", "(s),(mm),(N)"), TIME, MM, FORCE, quote=True, form="%.5f",
                                before=_SPANISH, end="\r\n").encode("cp1252"),
    "zwick": lines(('"Prüfzeit"\t"Standardweg"\t"Standardkraft"', '"s"\t"mm"\t"N"'), TIME, MM, FORCE, sep="\t",
                   before=_ZWICK, form="%.6f").encode("cp1252"),
    "instron": lines(('"Time","Extension","Load"', '"(s)","(mm)","(N)"'), TIME, MM, FORCE, quote=True, before=_HEAD,
                     form="%.5f").encode(),
    "mts": lines(("Laufzeit\tCh 1 Kraft Sollwert\tCh 1 Kraft\tCh 1 Weg", "s\tkN\tkN\tmm"), TIME, FORCE, FORCE, MM,
                 sep="\t", decimal=",", before=_MTS).encode(),
    "shimadzu": lines(('"1 _ 1","",""', '"Time","Force","Stroke"', '"sec","N","mm"'), TIME, FORCE, MM, quote=True,
                      end="\r\n").encode(),
    "cellscale": lines("SetName,Cycle,Time_S,Size_mm,Displacement_mm,Force_N", _SIZE, _SIZE, TIME, _SIZE, MM, FORCE)
    .replace("\n50.0000000,50.0000000,", "\nSet1,1-Stretch,").encode(),
    "workbook": component("importers", "workbook").example,
}  # fmt: skip

CUT, INSERT, FLIP, LINES, CELL, END = (
    "bytes cut",
    "bytes written in",
    "byte changed",
    "lines moved",
    "cells moved",
    "end cut",
)


@st.composite
def damages(draw: st.DrawFn, name: str) -> tuple[str, bytes]:
    """(how, content) of one damaged file."""
    data = FILES[name]
    kind = draw(st.sampled_from([CUT, INSERT, FLIP, LINES, CELL, END]))
    at = draw(st.integers(0, len(data) - 1))
    if kind == CUT:
        return kind, data[:at] + data[at + draw(st.integers(1, 60)) :]
    if kind == INSERT:
        return kind, data[:at] + draw(st.binary(min_size=1, max_size=20)) + data[at:]
    if kind == FLIP:
        return kind, data[:at] + bytes([draw(st.integers(0, 255))]) + data[at + 1 :]
    if kind == END:
        return kind, data[:at]
    rows = data.split(b"\n")
    i, j = draw(st.integers(0, len(rows) - 1)), draw(st.integers(0, len(rows) - 1))
    if kind == LINES:
        rows[i], rows[j] = rows[j], rows[i] if draw(st.booleans()) else rows[j]
        return kind, b"\n".join(rows)
    sign = next((s for s in (b"\t", b";", b",") if s in rows[i]), b",")
    cells = rows[i].split(sign)
    other = rows[j].split(sign)
    cells[draw(st.integers(0, len(cells) - 1))] = other[draw(st.integers(0, len(other) - 1))]
    rows[i] = sign.join(cells)
    return kind, b"\n".join(rows)


@dataclass(frozen=True)
class Verdict:
    """What became of a damaged file.

    outcome : "refused", "same", "fewer rows", "damaged rows only", "sizes lost" (it is no strip any more), "another
        scale or column", or one of `FAULTS`
    said : the import reported a contradiction or left something aside
    seconds : that it took
    detail : for people
    """

    outcome: str
    said: bool
    seconds: float
    detail: str = ""


FAULTS = ("traceback", "hang", "not finite", "refused without the file")


def judged(name: str, content: bytes) -> Verdict:
    """Import a damaged file and lay what comes out beside what the whole file holds."""
    began = time.perf_counter()
    try:
        found = read(content)
    except BayesmembraneError as error:
        return _timed("refused" if "export" in str(error) else FAULTS[3], False, began, str(error))
    except Exception:
        return _timed(FAULTS[0], False, began, traceback.format_exc())
    if found is None:
        return _timed("refused", False, began, "no importer")
    if not all(np.all(np.isfinite(v)) for v in found.columns.values()):
        return _timed(FAULTS[2], False, began)
    truth = read(FILES[name])
    assert truth is not None
    return _timed(compared(found.columns, truth.columns), bool(found.contradictions), began, str(found.guesses))


def _timed(outcome: str, said: bool, began: float, detail: str = "") -> Verdict:
    seconds = time.perf_counter() - began
    return Verdict(FAULTS[1] if seconds > LONGEST else outcome, said, seconds, detail)


def read(content: bytes) -> Imported | None:
    """What the importer that recognises a content makes of it, None if there is none."""
    importer: type[Importer] | None = recognising(content) if content.strip() else None
    return None if importer is None else importer.read_with(content, "export", Hints())


def compared(found: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray]) -> str:
    """How the columns of a damaged file differ from those of the whole one."""
    names = [n for n in truth if n != "time"] if "time" not in found else list(truth)
    if any(n not in found for n in names if n not in ("cycle", "direction")):
        return "sizes lost"
    names = [n for n in names if n in found]
    a, b = (np.stack([c[n] / np.max(np.abs(truth[n])) for n in names], axis=1) for c in (found, truth))
    if a.shape == b.shape and np.allclose(a, b, rtol=1e-9, atol=1e-12):
        return "same"
    known = np.array([np.min(np.max(np.abs(b - row), axis=1)) < 1e-9 for row in a])
    if np.all(known):
        return "fewer rows" if len(a) < len(b) else "damaged rows only"
    return "damaged rows only" if np.sum(~known) <= 5 else "another scale or column"


def every_layout() -> list[str]:
    """The names of `FILES`; raises `AssertionError` if an importer has none."""
    assert {n.partition(",")[0] for n in FILES} == set(components("importers"))
    return list(FILES)
