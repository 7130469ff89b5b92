"""The page on real cyclic tests under each declared energy: tables, and the sentences that follow from them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from tests.studies.cycles import Row

HEAD = """# Real cyclic tests: the answer with each energy declared, and with none

Made by `make study-cycles` (seed {seed}) from measurements that are not part of the project but for three of them:
strips of the acrylic tape VHB 4910, loaded once and unloaded at 0.01, 0.03 and 0.05 1/s to a stretch of 1.5, 2.0 and
2.5 (github.com/Chongran-Zhao/Viscoelastic-fitting, MIT), and once at 0.68 1/s to 5.4
(github.com/prmiles/pymcmcstat_examples, MIT). The tape relaxes: that is known of it, and nothing else is.

Written as measured. Rows that are not here were not run."""


def page(rows: Sequence[Row], seed: int, note: str = "") -> str:
    """Markdown of the whole page."""
    known = [r for r in rows if r.seed == seed]
    declared = list(dict.fromkeys(r.declared for r in known))
    parts = [HEAD.format(seed=seed), *([note] if note else []), "## In short", _short(known)]
    for name in declared:
        parts += [f"## {'No energy declared' if name == 'none' else f'Declared: {name}'}", _table(known, name)]
    return "\n\n".join(parts) + "\n"


def _short(rows: Sequence[Row]) -> str:
    by: dict[str, list[Row]] = {}
    for r in rows:
        by.setdefault(r.name, []).append(r)
    several = [group for group in by.values() if len(group) > 1]
    same = sum(len({(r.verdict, r.effects) for r in group}) == 1 for group in several)
    alike = sum(len({next(iter(r.sets)) for r in group}) == 1 for group in several)
    out = []
    for name in dict.fromkeys(r.declared for r in rows):
        own = [r for r in rows if r.declared == name]
        first = _counts(next(iter(r.sets)) for r in own)
        out.append(
            f"- {'No energy' if name == 'none' else name} declared, {len(own)} tests: "
            f"{_counts(r.verdict for r in own)}. Most probable set: {first}. Relaxation among the most probable set: "
            f"{sum('viscoelastic' in next(iter(r.sets)) for r in own)}; hysteresis: "
            f"{sum('hysteresis' in next(iter(r.sets)) for r in own)}."
        )
    if several:
        out.append(
            f"- Of {len(several)} tests that were diagnosed under several declarations, the verdict and its effects "
            f"are the same in all of them in {same}, and the most probable set in {alike}."
        )
    seconds = [r.seconds for r in rows]
    out.append(
        f"- One core takes {min(seconds):.0f} to {max(seconds):.0f} s, median {np.median(seconds):.0f} s, on a machine "
        f"that did other work. Readings set aside: {sum(r.set_aside for r in rows)} of {sum(r.readings for r in rows)}."
    )
    return "\n".join(out)


def _table(rows: Sequence[Row], declared: str) -> str:
    head = (
        "| test | readings | verdict | sets of effects | energies | foreign | residual, kPa | reduced chi-square left "
        "| held out inside 90 % | CPU, s |"
    )
    lines = [head, "|" + "---|" * (head.count("|") - 1)]
    for r in (r for r in rows if r.declared == declared):
        covered = "" if r.covered is None else f"{100 * r.covered:.0f} %"
        cells = [
            *(r.name, str(r.readings), r.verdict, _listed(r.sets), _listed(r.energies), f"{r.foreign:.2f}"),
            *(f"{r.before:.3g} -> {r.after:.3g}", f"{r.chi2:.3g}", covered, f"{r.seconds:.0f}"),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _listed(found: dict[str, float]) -> str:
    told = {k: v for k, v in found.items() if v >= 0.01}
    return ", ".join(f"{k} {v:.2f}" for k, v in told.items())


def _counts(values: Iterable[str]) -> str:
    return ", ".join(f"`{name}` {n}" for name, n in Counter(values).most_common())
