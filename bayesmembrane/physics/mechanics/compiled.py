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
from typing import Any, TypeVar

from bayesmembrane.ground.compiling import compiled
from bayesmembrane.physics.materials.base import Material

OPTIONS = {"nogil": True, "error_model": "numpy", "fastmath": {"contract", "arcp"}}
# numba watches the file of a kernel, not those it borrows from: their texts go into its name.
BORROWED = ("ritz/simd.py",)
_INLINED: set[Callable[..., Any]] = set()

Kernel = TypeVar("Kernel", bound=Callable[..., Any])


def inlined(kernel: Kernel) -> Kernel:
    """A kernel whose text is put where it is called: for a long one with one caller, which would be compiled twice.

    Not for what is called all the time: the Ritz loop ran 15 to 20 % slower for it.
    """
    _INLINED.add(kernel)
    return kernel


@cache
def bind(kernels: tuple[Callable[..., Any], ...], material: type[Material], **constants: Any) -> SimpleNamespace:
    """Compile ``kernels`` (in calling order, callees first) for one material.

    Returns a namespace with the compiled functions under their own names. ``constants`` replace module globals of the
    same name. Kernels that neither know the material nor a constant are compiled once, for all materials.
    """
    physics = (material.derivatives, material.sensitivities)
    names = {f.__name__ for f in physics} | set(constants)
    alike = tuple(k for k in kernels if k.__name__ not in _touched(kernels, names))
    shared, texts = _shared(alike), _texts(kernels)
    tag = f"{material.__qualname__}_{_mark(material.source_text(), texts, repr(sorted(constants.items())))}"
    # The material's module may use its own imports (np, math): its functions keep their own globals.
    bound = {f.__name__: _compile(f, f.__globals__, tag) for f in physics}
    namespace = {**_globals(kernels), **shared, **bound, **constants}
    for kernel in kernels:
        if kernel not in alike:
            namespace[kernel.__name__] = _compile(kernel, namespace, tag)
    return SimpleNamespace(**{kernel.__name__: namespace[kernel.__name__] for kernel in kernels})


def _touched(kernels: tuple[Callable[..., Any], ...], names: set[str]) -> set[str]:
    """The ``names``, and those of all kernels that use them, by themselves or by what they call."""
    names = set(names)
    for kernel in kernels:
        if names.intersection(kernel.__code__.co_names):
            names.add(kernel.__name__)
    return names


@cache
def _shared(kernels: tuple[Callable[..., Any], ...]) -> dict[str, Any]:
    """Compiled kernels that no material changes, by name."""
    namespace, made = _globals(kernels), {}
    tag = _mark(_texts(kernels))
    for kernel in kernels:
        made[kernel.__name__] = namespace[kernel.__name__] = _compile(kernel, namespace, tag)
    return made


def _globals(kernels: tuple[Callable[..., Any], ...]) -> dict[str, Any]:
    """What the modules of these kernels know."""
    found: dict[str, Any] = {}
    for kernel in kernels:
        found.update(vars(sys.modules[kernel.__module__]))
    return found


def _texts(kernels: tuple[Callable[..., Any], ...]) -> str:
    borrowed = [Path(__file__).parent.joinpath(name).read_text(encoding="utf-8") for name in BORROWED]
    return "".join([*map(inspect.getsource, kernels), *borrowed])


def _mark(*texts: str) -> str:
    return hashlib.sha256("".join(texts).encode()).hexdigest()[:10]


def _compile(function: Any, namespace: dict[str, Any], tag: str) -> Any:
    copy = FunctionType(function.__code__, namespace, f"{function.__name__}_{tag}", function.__defaults__)
    copy.__qualname__ = copy.__name__
    copy.__module__ = function.__module__
    return compiled(**OPTIONS, inline="always" if function in _INLINED else "never")(copy)
