"""Columns that say again what the curve of a strip says: compared with it, and not used otherwise."""

from __future__ import annotations

import numpy as np

from bayesmembrane.data.exports.columns import ENGINEERING, TRUE, PossibleColumn, Read, left_over, read
from bayesmembrane.data.exports.export import Export
from bayesmembrane.data.exports.relations import contradiction
from bayesmembrane.data.exports.signs import carried, turned_alike
from bayesmembrane.data.exports.words import STRAIN
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.units import STRESS

_WORDS = {
    (STRAIN, TRUE): "true strain and the logarithm of the stretch",
    (STRAIN, ENGINEERING): "engineering strain and the stretch less 1",
    (STRESS, TRUE): "true stress and engineering stress times stretch",
    (STRESS, ENGINEERING): "engineering stress and the nominal stress of the curve",
}


def compare_rest(export: Export, stretch: Array, nominal: Array) -> None:
    """Hold strains and stresses that were not chosen against the curve (N,), and say where they contradict it."""
    same = {
        (STRAIN, TRUE): np.log(stretch),
        (STRAIN, ENGINEERING): stretch - 1.0,
        (STRESS, TRUE): nominal * stretch,
        (STRESS, ENGINEERING): nominal,
    }
    compared = []
    for column in left_over(export.block, export.used, export.hints):
        what = column.role, _kind(export, column)
        said = _values(export, column, same[what]) if what in same else None
        if said is not None:
            export.contradict(contradiction(_WORDS[what], said.values, same[what], export.lines, said.unit))
            compared.append(said.column)
    export.used |= {c.at for c in compared}
    if compared:
        export.notes.append(f"compared with the curve, and not used: {', '.join(c.header for c in compared)}")


def _kind(export: Export, column: PossibleColumn) -> str:
    """Which strain or stress a column holds; one that does not say is engineering beside a true one that is used."""
    used = {c.kind for c in export.found if c.role == column.role and c.column.at in export.used}
    return column.kind or (ENGINEERING if used == {TRUE} else "")


def _values(export: Export, column: PossibleColumn, reference: Array) -> Read | None:
    """The values of a column as the curve would have them; None if it has no unit, or a cell without a number."""
    try:
        found = read(export.block, column, export.rows, export.hints)
    except DataError:
        return None
    return carried(export, found) if column.role == STRESS else turned_alike(export, found, reference)
