"""Travel and force as a film feels them: their signs, and where they are zero."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayesmembrane.data.exports.columns import Read
from bayesmembrane.data.exports.export import Export
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import component

RESTS = 0.02
"""A force below this part of the largest counts as none: the film is at rest there."""
AWAY = 0.02, 0.2
"""By these parts of its range, back or ahead, a first travel may lie off the second; more is no start of a test."""
NEAR = 0.05
"""A travel that starts within this part of its range starts near zero."""


_FLIPS = {"keep": (1, 1), "flip": (-1, -1), "flip-force": (1, -1), "flip-travel": (-1, 1)}


def signed(export: Export, x: Array, f: Array, free: bool) -> tuple[Array, Array]:
    """Travel and force so that both are positive where the film is pulled; ``free``: a push is a pull from below."""
    said = export.hints.sign
    if said:
        export.guess("sign", said, "it was said", "--sign")
        return _FLIPS[said][0] * x, _FLIPS[said][1] * f
    at = int(np.argmax(np.abs(f)))
    back, pushed = bool(x[at] < x[0]), bool(f[at] < 0)
    if _presses(export) and not free:
        if not back or not pushed:
            why = "the rig presses, and the file counts that as positive"
            export.guess("sign", "turned round where positive", why, "--sign")
        return (x if back else -x), (f if pushed else -f)
    if not back and not pushed:
        return x, f
    if not free:
        _agree(export, back, pushed, "travel")
        export.guess("sign", "kept", "travel and force are negative, as in compression", "--sign")
        return x, f
    words = {(True, True): "travel and force are", (True, False): "the travel is", (False, True): "the force is"}
    why = f"{words[back, pushed]} negative where most is carried, and a lifted disc has both positive"
    turned = "both" if back and pushed else "travel" if back else "force"
    export.guess("sign", f"{turned} turned round", why, "--sign")
    return (0.0 - x if back else x), (0.0 - f if pushed else f)


def _presses(export: Export) -> bool:
    rig = export.hints.rig
    return bool(rig) and component("rigs", rig).presses


def _agree(export: Export, back: bool, pushed: bool, what: str) -> None:
    """Raise `DataError` where a strip gets longer under a push, or shorter under a pull."""
    if back != pushed:
        which = f"force is negative and the {what} goes on" if pushed else f"{what} goes back and the force is positive"
        pulled, pressed = ("flip-force", "flip-travel") if pushed else ("flip-travel", "flip-force")
        remedy = f"say --sign {pulled} if it was pulled, {pressed} if it was pressed"
        raise DataError(f"where most is carried the {which}", export.block.place, remedy)


def lengthened(export: Export, e: Array, travel: Array | None, load: Read | None) -> Array:
    """A strip's own strain, positive where it gets longer, as `signed` does it with its travel (N,) m."""
    f = load.values if load is not None else np.zeros(e.size)
    at = int(np.argmax(np.abs(f)))
    back = bool(e[at] < e[0])
    if export.hints.sign:
        raw_back = bool(travel is not None and travel[at] < travel[0])
        turn = _FLIPS[export.hints.sign][0] < 0 and (travel is None or raw_back != back)
        return -e if turn else e
    if _presses(export):
        if travel is None and not back:
            why = "the rig presses, and the file counts that as positive"
            export.guess("sign", "turned round where positive", why, "--sign")
        return e if back else -e
    if travel is None and f[at]:
        _agree(export, back, bool(f[at] < 0), "strain")
    return e


def turned_alike(export: Export, strain: Read, used: Array) -> Read:
    """A strain that is only compared with the ``used`` one (N,): turned where that may be, from its start as said."""
    e = strain.values - strain.values[0] if "travel" in export.hints.zero else strain.values
    turns = bool(export.hints.sign) or _presses(export)
    return replace(strain, values=-e if turns and float(np.dot(e, used)) < 0 else e)


def carried(export: Export, load: Read | None) -> Read | None:
    """A strip's force or stress, positive where it is pulled, and from its start if that was said."""
    if load is None:
        return None
    f = load.values
    if export.hints.sign:
        f = _FLIPS[export.hints.sign][1] * f
    elif _presses(export) and f[int(np.argmax(np.abs(f)))] > 0:
        f = -f
    return replace(load, values=f - f[0] if "force" in export.hints.zero else f)


def zero_told(export: Export, load: Read | None, what: str) -> None:
    """Say where the force of a strip is zero, if it does not start there."""
    if load is not None:
        if "force" in export.hints.zero:
            export.guess(f"zero of the {what}", "where it starts", "it was said", "--zero")
        else:
            _as_it_is(export, load.values, what)


def zeroed(export: Export, travel: Read, x: Array, f: Array) -> Array:
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
    absolute = any(c.reading.absolute for c in export.found if c.column.at == travel.column.at)
    rests = abs(float(f[0])) <= RESTS * float(np.max(np.abs(f)))
    ahead = float(np.sign(x[int(np.argmax(np.abs(f)))] - x[1]) * (x[1] - x[0]))
    if x.size >= 10 and not -AWAY[0] * reach <= ahead <= AWAY[1] * reach:
        fault = f"the travel starts at {1e3 * start:.4g} mm and goes on at {1e3 * x[1]:.4g} mm"
        raise DataError(fault, export.block.sheet.place(export.rows[0]), "correct the first line, or say --zero none")
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
    share = 100 * abs(f[0]) / np.max(np.abs(f))
    fault = f"the travel starts at {1e3 * start:.4g} mm under {share:.3g} % of the largest load"
    raise DataError(
        fault,
        export.block.sheet.place(export.rows[0]),
        "say --zero none if it counts from rest, --zero travel if it starts there",
    )


def zeroed_force(export: Export, f: Array) -> Array:
    """The force as the file has it, or from its start if that was said."""
    said, start = export.hints.zero, float(f[0])
    if "force" in said:
        export.guess("zero of the force", f"{start:.4g} N", "it was said: where it starts", "--zero")
        return f - start
    _as_it_is(export, f, "force")
    return f


def _as_it_is(export: Export, f: Array, what: str) -> None:
    """Say that a force does not start at zero and was left so."""
    start, largest = abs(float(f[0])), float(np.max(np.abs(f)))
    if start > 0.01 * largest:
        why = f"its start at {100 * start / largest:.3g} % of the largest may be a preload"
        export.guess(f"zero of the {what}", "as the file has it", why, "--zero force")
