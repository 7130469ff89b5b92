"""Whether two frozen results are the same values."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def stored_equals_given(a: Any, b: Any) -> None:
    """Fail unless ``b`` has the types and, to the last bit, the values of ``a``, all the way down."""
    assert type(a) is type(b), (a, b)
    if isinstance(a, dict):
        assert list(a) == list(b)
        for name in a:
            stored_equals_given(a[name], b[name])
    elif isinstance(a, list | tuple):
        assert len(a) == len(b)
        for one, other in zip(a, b, strict=True):
            stored_equals_given(one, other)
    elif isinstance(a, np.ndarray | np.generic):
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)
    elif is_dataclass(a) and not isinstance(a, type):
        for f in fields(a):
            stored_equals_given(getattr(a, f.name), getattr(b, f.name))
    else:
        assert a == b or (a != a and b != b), (a, b)
