"""A vector of `LANES` doubles for numba: the same arithmetic on several films at once.

numba's loop vectoriser gives up on the Ritz kernels (it cannot prove that a banded matrix does not overlap itself), so
the vector is a type of its own. ``load`` and ``store`` move one row of a C-contiguous (rows, LANES) float64 array;
+ - * /, np.sqrt, np.log, np.exp, ``least`` and ``greatest`` work lane by lane and mix with plain floats. A material's
``derivatives`` compiles for this type and for floats from one text.
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, lower_builtin, lower_cast, models, overload, register_model, type_callable

LANES = 8
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)


class Lanes(types.Type):
    """numba type of one vector."""

    def __init__(self) -> None:
        super().__init__(name=f"float64x{LANES}")


lanes = Lanes()


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, _VECTOR)


def _splat(builder: Any, value: Any) -> Any:
    single = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), value, ir.IntType(32)(0))
    mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(single, ir.Constant(_VECTOR, ir.Undefined), mask)


def _as_vector(context: Any, builder: Any, value: Any, kind: Any) -> Any:
    if isinstance(kind, Lanes):
        return value
    return _splat(builder, context.cast(builder, value, kind, types.float64))


@lower_cast(types.Float, Lanes)
@lower_cast(types.Integer, Lanes)
def _cast(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return _as_vector(context, builder, value, source)


def _register(function: Any, instruction: str) -> None:
    @type_callable(function)
    def typing(context: Any) -> Any:
        def typer(a: Any, b: Any) -> Any:
            kinds = (a, b)
            if any(isinstance(x, Lanes) for x in kinds) and all(isinstance(x, Lanes | types.Number) for x in kinds):
                return lanes
            return None

        return typer

    def lower(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        a, b = (_as_vector(context, builder, v, k) for v, k in zip(args, signature.args, strict=True))
        return getattr(builder, instruction)(a, b, flags=("contract", "arcp"))

    for pair in ((Lanes, Lanes), (Lanes, types.Number), (types.Number, Lanes)):
        lower_builtin(function, *pair)(lower)


for _function, _instruction in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
    (operator.iadd, "fadd"),
    (operator.isub, "fsub"),
    (operator.imul, "fmul"),
    (operator.itruediv, "fdiv"),
):
    _register(_function, _instruction)


@type_callable(operator.neg)
def _type_neg(context: Any) -> Any:
    return lambda a: lanes if isinstance(a, Lanes) else None


@lower_builtin(operator.neg, Lanes)
def _lower_neg(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    return builder.fneg(args[0])


def _unary(name: str) -> Any:
    @intrinsic
    def call(typing_context: Any, a: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            kind = ir.FunctionType(_VECTOR, [_VECTOR])
            function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f64")
            return builder.call(function, args)

        return lanes(lanes), generate

    return call


_sqrt, _log, _exp, _fabs = (_unary(name) for name in ("sqrt", "log", "exp", "fabs"))


def _extend(function: Any, implementation: Any) -> None:
    # numba compares the two signatures, annotations included: neither carries any.
    @overload(function)
    def choose(a):  # type: ignore[no-untyped-def]
        return (lambda a: implementation(a)) if isinstance(a, Lanes) else None


for _function, _implementation in ((np.sqrt, _sqrt), (np.log, _log), (np.exp, _exp), (abs, _fabs)):
    _extend(_function, _implementation)


def _choose(comparison: str) -> Any:
    @intrinsic
    def call(typing_context: Any, a: Any, b: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            a, b = (_as_vector(context, builder, v, k) for v, k in zip(args, signature.args, strict=True))
            return builder.select(builder.fcmp_unordered(comparison, a, b), a, b)

        return lanes(a, b), generate

    return call


least, greatest = _choose("<"), _choose(">")
"""Lane-wise minimum and maximum of (new, old); a nan in ``new`` wins and stays visible."""


def _row_pointer(context: Any, builder: Any, kind: Any, array: Any, row: Any, row_kind: Any) -> Any:
    row = context.cast(builder, row, row_kind, types.intp)
    data = context.make_array(kind)(context, builder, array).data
    pointer = builder.gep(data, [builder.mul(row, row.type(LANES))])
    return builder.bitcast(pointer, _VECTOR.as_pointer())


@intrinsic
def load(typing_context: Any, array: Any, row: Any) -> Any:
    """Row ``row`` of a C-contiguous (rows, LANES) float64 array as a vector; the index is not checked."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pointer = _row_pointer(context, builder, signature.args[0], args[0], args[1], signature.args[1])
        value = builder.load(pointer)
        value.align = 8
        return value

    return lanes(array, row), generate


@intrinsic
def store(typing_context: Any, array: Any, row: Any, value: Any) -> Any:
    """Write a vector (or a float, to every lane) to row ``row`` of a C-contiguous (rows, LANES) array, unchecked."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pointer = _row_pointer(context, builder, signature.args[0], args[0], args[1], signature.args[1])
        builder.store(_as_vector(context, builder, args[2], signature.args[2]), pointer).align = 8
        return context.get_dummy_value()

    return types.void(array, row, value), generate


@intrinsic
def load_all(typing_context: Any, array: Any, template: Any) -> Any:
    """The first len(template) rows as a tuple of vectors; ``template`` is a tuple of floats, read for its length."""
    count = len(template)
    result = types.UniTuple(lanes, count)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        values = []
        for i in range(count):
            row = ir.IntType(64)(i)
            pointer = _row_pointer(context, builder, signature.args[0], args[0], row, types.intp)
            value = builder.load(pointer)
            value.align = 8
            values.append(value)
        return context.make_tuple(builder, result, values)

    return result(array, template), generate


@intrinsic
def splat(typing_context: Any, value: Any) -> Any:
    """A vector with the same float in every lane."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return _as_vector(context, builder, args[0], signature.args[0])

    return lanes(value), generate


@intrinsic
def where(typing_context: Any, mask: Any, a: Any, b: Any) -> Any:
    """Lane by lane ``a`` where ``mask`` is not zero, else ``b``; whatever is not chosen may be nan."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        m, x, y = (_as_vector(context, builder, v, k) for v, k in zip(args, signature.args, strict=True))
        return builder.select(builder.fcmp_unordered("!=", m, ir.Constant(_VECTOR, [0.0] * LANES)), x, y)

    return lanes(mask, a, b), generate
