"""What remembers the way: a stop, a direction that is followed over a length, play, and relaxation with its kernel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

GAUSS = ((0.5 - np.sqrt(0.15), 5 / 18), (0.5, 8 / 18), (0.5 + np.sqrt(0.15), 5 / 18))


def stop_operator(x: Any, threshold: float) -> Any:
    """(N,) spring in series with a slider: follows the changes of ``x`` between -threshold and threshold."""
    out, now = np.zeros(len(x)), 0.0
    for i, change in enumerate(np.diff(x, prepend=x[0]).tolist()):
        now = min(max(now + change, -threshold), threshold)
        out[i] = now
    return out


def direction_followed(x: Any, length: float) -> Any:
    """(N,) from -1 to 1: the sign of the motion, approached exponentially over a length."""
    out, now = np.zeros(len(x)), 0.0
    changes = np.diff(x, prepend=x[0])
    kept = np.exp(-abs(changes) / length).tolist()
    for i, change in enumerate(changes.tolist()):
        if change:
            sign = 1.0 if change > 0 else -1.0
            now = sign + (now - sign) * kept[i]
        out[i] = now
    return out


def play_operator(x: Any, gap: float) -> Any:
    """(N,) what is moved by ``x`` through a gap; it begins at 0, behind by the gap on the way up."""
    out, now = [], 0.0
    for value in x:
        now = min(max(now, value - gap), value)
        out.append(now)
    return np.array(out)


def relaxation_kernel(form: str, details: Mapping[str, Any], time: Any) -> Any:
    """(N, N - 1) what is left, at each reading, of a force that grew evenly between two readings before it."""
    count, begin, end = len(time), time[:-1], time[1:]
    out = np.zeros((count, count - 1))
    for place, weight in GAUSS:
        lag = np.maximum(time[:, None] - (begin + (end - begin) * place)[None], 0)
        out += weight * _left(form, details, lag)
    out *= np.arange(count)[:, None] > np.arange(count - 1)[None]
    return out


def _left(form: str, details: Mapping[str, Any], lag: Any) -> Any:
    times, n = details["tau"], details["exponent"]
    if form.startswith("prony"):
        return sum(w * np.exp(-lag / tau) for w, tau in zip(details["weights"], times, strict=True))
    if form == "power":
        return (1 + lag / times[0]) ** -n
    return 1 / (1 + (lag / times[0]) ** n)
