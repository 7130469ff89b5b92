"""``convexity``: whether a strain energy is one on a box of stretches."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from bayesmembrane.app.options import FilmOptions, OutputOptions, StoredOnRequestOption
from bayesmembrane.app.terminal import answer, numbers, say
from bayesmembrane.ground.errors import SettingsError

if TYPE_CHECKING:
    from bayesmembrane.physics.materials.base import Material

place = 2


def verb(
    film: FilmOptions,
    stored: StoredOnRequestOption,
    output: OutputOptions,
    box: Annotated[str, typer.Option(help="Stretches between which W(l1, l2) must be convex.")] = "1,8",
) -> None:
    """Whether an energy is convex in the stretches on a box, by what margin, and where it is worst."""
    from bayesmembrane.app.answers import Asked, kept
    from bayesmembrane.ground.fingerprint import digest
    from bayesmembrane.ground.registry import material as named
    from bayesmembrane.physics.mechanics.convexity import box_convexity, box_ellipticity

    edges = numbers(box, "--box")
    if len(edges) != 2:
        raise SettingsError(
            f"a box has two edges, and {len(edges)} were given", where="--box", remedy="write --box 1,8"
        )
    made = named(film.material).from_vector(numbers(film.parameters, "--parameters"))
    found, elliptic = box_convexity(made, *edges), box_ellipticity(made, *edges)
    document = {
        "material": made.name,
        "convex": found.convex,
        "margin": found.margin,
        "worst": dict(zip(("l1", "l2"), found.worst, strict=True)),
        "elliptic": elliptic.elliptic,
        "elliptic_margin": elliptic.margin,
        "box": edges,
        "stability_limits": _limits(made),
    }
    l1, l2 = found.worst
    sentence = (
        f"{made.title} with {film.parameters} is {'' if found.convex else 'not '}convex on "
        f"[{edges[0]:g}, {edges[1]:g}]^2: least eigenvalue of the Hessian {found.margin:.4g} G d, at stretches "
        f"({l1:.4g}, {l2:.4g}); it is {'' if elliptic.elliptic else 'not '}elliptic there (least of P11, P22: "
        f"{elliptic.margin:.4g} G d)."
    )
    settings = {"parameters": made.vector.tolist(), "box": edges}
    what = Asked("convexity", "", made.name, float("nan"), digest(settings))
    kept_as = kept("convexity", {**document, **settings}, document, what, stored.folder)
    answer(
        kept_as.document,
        output.as_json,
        lambda: say(f"{sentence}\n{_stability_sentence(document['stability_limits'])}"),
    )


def _limits(film: Material) -> dict[str, dict[str, float | None]]:
    """Stretch at which each mode loses stability, in compression and in tension; None where it does not."""
    from bayesmembrane.physics.stability import stability

    found: dict[str, dict[str, float | None]] = {}
    for (mode, side), limit in stability(type(film), film.vector).limits.items():
        found.setdefault(mode, {})[side] = float(limit[0]) if limit[0] == limit[0] else None
    return found


def _stability_sentence(limits: Any) -> str:
    """The limits in a line."""
    said = [f"{mode} {side} {limit:.4g}" for mode, sides in limits.items() for side, limit in sides.items() if limit]
    return f"It loses stability (Drucker) at the stretches: {', '.join(said) or 'none between 0.1 and 10'}."
