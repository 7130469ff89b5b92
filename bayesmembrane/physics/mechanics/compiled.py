"""Generic kernels, compiled once per material and kept on disk.

A kernel is a plain Python function that calls ``derivatives`` (and ``sensitivities``) as if they were globals. ``bind``
copies a list of kernels into a namespace in which these names are one material's own, and compiles them with numba.
The copy carries the material and a hash of its source in its name, so numba's on-disk cache tells materials apart and
notices when one changes; a closure over a compiled function would be recompiled in every process.
"""

from __future__ import annotations

import hashlib
import inspect
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import FunctionType, SimpleNamespace
from typing import Any

from bayesmembrane.ground.compiling import compiled
from bayesmembrane.physics.materials.base import Material

OPTIONS = {"nogil": True, "error_model": "numpy", "fastmath": {"contract", "arcp"}}
# numba watches the file of a kernel, not those it borrows from: their texts go into its name.
BORROWED = ("ritz/simd.py",)


@cache
def bind(kernels: tuple[Callable[..., Any], ...], material: type[Material], **constants: Any) -> SimpleNamespace:
    """Compile ``kernels`` (in calling order, callees first) for one material.

    Returns a namespace with the compiled functions under their own names. ``constants`` replace module globals of the
    same name.
    """
    borrowed = [Path(__file__).parent.joinpath(name).read_text(encoding="utf-8") for name in BORROWED]
    parts = [material.source_text(), *map(inspect.getsource, kernels), repr(sorted(constants.items())), *borrowed]
    source = "".join(parts)
    tag = f"{material.__qualname__}_{hashlib.sha256(source.encode()).hexdigest()[:10]}"
    physics = (material.derivatives, material.sensitivities)
    namespace: dict[str, Any] = {}
    for kernel in kernels:
        namespace.update(vars(sys.modules[kernel.__module__]))
    # The material's module may use its own imports (np, math): its functions keep their own globals.
    namespace.update({f.__name__: _compile(f, f.__globals__, tag) for f in physics}, **constants)
    made = {}
    for kernel in kernels:
        made[kernel.__name__] = namespace[kernel.__name__] = _compile(kernel, namespace, tag)
    return SimpleNamespace(**made)


def _compile(function: Any, namespace: dict[str, Any], tag: str) -> Any:
    copy = FunctionType(function.__code__, namespace, f"{function.__name__}_{tag}", function.__defaults__)
    copy.__qualname__ = copy.__name__
    copy.__module__ = function.__module__
    return compiled(**OPTIONS)(copy)
