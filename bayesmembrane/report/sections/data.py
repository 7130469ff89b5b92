"""The data: what was measured, on which film and rig, and where it comes from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from bayesmembrane.reconstruction.result import Reconstruction
from bayesmembrane.report.blocks import Block, Table, Text, facts_table
from bayesmembrane.report.runs import Shown, ShownFilm, by_points, reach
from bayesmembrane.report.sections.base import Section, of_kind
from bayesmembrane.words.language import listed
from bayesmembrane.words.origin import origin


class DataSection(Section):
    """One table for each set of fitted points."""

    name = "data"
    title = "Data"
    order = 20

    def blocks(self, results: Sequence[Any]) -> Sequence[Block]:
        shown = of_kind(results, Shown)
        if not shown:
            return ()
        out: list[Block] = [Text(origin(r)) for r in of_kind(results, Reconstruction)]
        before = ""
        for group in by_points(shown):
            out.append(_table(group[0], before, reach(group[0], shown)))
            before = group[0].film.origin
        return out


def _table(s: Shown, before: str, end: str) -> Table:
    """What is known of a measurement; an origin that is that of the table ``before`` is not told again."""
    d, film, how = s.digest, s.film, s.how
    factor, unit = how.small
    of = "" if how.bare else f" of {how.travel}"
    low, high = (float(f(how.carried(d.force))) for f in (np.min, np.max))
    noise = (
        f"stated noise {factor * float(np.min(d.sd)):.3g} to {factor * float(np.max(d.sd)):.3g} {unit} (sd)"
        if d.has_noise
        else "no stated noise: it is inferred"
    )
    facts = {
        "specimen": film.name,
        "thickness": f"{1e6 * film.thickness:.4g} um",
        "rig": _rig(film),
        "points": f"{d.at.size}, from {how.place(float(np.min(d.at)))} to {s.end}{of}",
        "stresses" if how.bare else "forces": f"{low:.4g} to {high:.4g} {how.load_scale[1]}; {noise}",
        "whole measurement": f"up to {how.place(d.full_range)}",
        "files": ", ".join(f for f in film.files if f) or "-",
        "origin": "as above" if before and film.origin == before else film.origin or "not stated",
        "notes": "; ".join(film.notes) or "none",
        "data hash (SHA-256)": s.data_hash,
    }
    return facts_table(f"data up to {end}", f"The {how.curve}, fitted up to {end}.", facts)


def _rig(film: ShownFilm) -> str:
    """Its lengths, and what the page's forces and deflections stand for, if they are not what was measured."""
    rig = film.rig
    lengths = listed(f"{name.replace('_', ' ')} {1e3 * v:.4g} mm" for name, v in rig.lengths.items())
    remark = rig.remark_on_units(film.thickness)
    return f"{rig.title}, {lengths}" + (f"; {remark}" if remark else "")
