"""Plain values for JSON and TOML: what is not a finite number is null."""

from __future__ import annotations

import json
import math
from dataclasses import fields, is_dataclass
from typing import Any


def plain(value: Any) -> Any:
    """Mappings, sequences, dataclasses, arrays and NumPy scalars as what JSON knows; nan and infinity as None."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if isinstance(value, str | int | float | bool | None) else str(value)


def json_text(value: Any, indent: int | None = None) -> str:
    """One JSON document of `plain` values."""
    return json.dumps(plain(value), indent=indent, allow_nan=False, ensure_ascii=False)
