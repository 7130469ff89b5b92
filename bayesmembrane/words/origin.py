"""Where a reconstructed curve comes from, in words."""

from __future__ import annotations

from bayesmembrane.reconstruction.result import Reconstruction
from bayesmembrane.reconstruction.rows import Suspect
from bayesmembrane.words.hypothesis import material_title
from bayesmembrane.words.language import listed, millimetres
from bayesmembrane.words.reconstruction import contradiction


def origin(found: Reconstruction) -> str:
    """That the curve is reconstructed, how many points it has, and which printed rows contradict the rest."""
    counts = [max(r.n_points.items(), key=lambda i: i[1]) for r in found.ranges]
    ranges = listed(
        f"{n} points up to {millimetres(r.deflection.max())} (the paper's {r.name}; probability {p:.2g})"
        for r, (n, p) in zip(found.ranges, counts, strict=True)
    )
    suspects = listed(f"{material_title(s.material)} {s.column}" for s in found.suspects)
    rows = f"printed rows that contradict the rest: {suspects}" if suspects else "no printed row contradicts the rest"
    return f"The curve is not raw data: it was reconstructed from published losses, {ranges}; {rows}."


def suspect(found: Suspect) -> str:
    """A printed row that contradicts the rest, why, and the smallest change that mends it."""
    changes = listed(f"{c.entry} {c.printed} to {c.consistent:g}" for c in found.corrections)
    mend = f"; smallest change that mends it: {changes}" if changes else ""
    return f"{material_title(found.material)} {found.column}: {contradiction(found)}{mend}."
