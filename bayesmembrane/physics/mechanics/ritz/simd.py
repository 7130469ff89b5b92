"""A vector of `LANES` doubles for numba: the same arithmetic on several films at once.

numba's loop vectoriser gives up on the Ritz kernels (it cannot prove that a banded matrix does not overlap itself), so
the vector is a type of its own. ``load`` and ``store`` move one row of a C-contiguous (rows, LANES) float64 array;
+ - * /, np.sqrt, np.log, np.exp, ``least`` and ``greatest`` work lane by lane and mix with plain floats. A material's
``derivatives`` compiles for this type and for floats from one text.
"""

from __future__ import annotations

import inspect
import operator
from math import factorial
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import (
    intrinsic,
    lower_builtin,
    lower_cast,
    models,
    overload,
    register_jitable,
    register_model,
    type_callable,
)

LANES = 8
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)


class Lanes(types.Type):  # type: ignore[misc]
    """numba type of one vector."""

    def __init__(self) -> None:
        super().__init__(name=f"float64x{LANES}")


lanes = Lanes()


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):  # type: ignore[misc]
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


_sqrt, _fabs = (_unary(name) for name in ("sqrt", "fabs"))

# ---- exp and log: LLVM would call the scalar ones of libm lane by lane -----------------------------------------------

_INTEGERS = ir.VectorType(ir.IntType(64), LANES)
# Adding it to a number below 2^51 leaves the number, rounded, in the lowest bits.
_ROUNDING = 1.5 * 2.0**52
_LOG2_E = float(np.log2(np.e))
# ln 2 in two parts (fdlibm): integers up to 2^20 times the first are exact.
_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_FACTORIALS = tuple(1.0 / float(factorial(k)) for k in range(14))
_TINY = float(np.finfo(float).tiny)
_ROOT_HALF = 0x3FE6A09E667F3BCD
_ONE = 0x3FF0000000000000


def _integers(value: int) -> Any:
    return ir.Constant(_INTEGERS, [value] * LANES)


@intrinsic
def _power_of_two(typing_context: Any, n: Any) -> Any:
    """2^n for whole numbers n in [-1022, 1023]."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        bits = builder.bitcast(builder.fadd(args[0], ir.Constant(_VECTOR, [_ROUNDING] * LANES)), _INTEGERS)
        return builder.bitcast(builder.add(builder.shl(bits, _integers(52)), _integers(_ONE)), _VECTOR)

    return lanes(lanes), generate


@intrinsic
def _split(typing_context: Any, x: Any) -> Any:
    """(n, m) with x = 2^n m and m in [sqrt(1/2), sqrt(2)), for normal x > 0."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        bits = builder.bitcast(args[0], _INTEGERS)
        biased = builder.lshr(builder.add(bits, _integers(_ONE - _ROOT_HALF)), _integers(52))
        n = builder.sub(biased, _integers(1023))
        m = builder.bitcast(builder.sub(bits, builder.shl(n, _integers(52))), _VECTOR)
        rounding = ir.Constant(_VECTOR, [_ROUNDING] * LANES)
        whole = builder.bitcast(builder.add(n, builder.bitcast(rounding, _INTEGERS)), _VECTOR)
        return context.make_tuple(builder, signature.return_type, (builder.fsub(whole, rounding), m))

    return types.UniTuple(lanes, 2)(lanes), generate


@intrinsic
def _if_less(typing_context: Any, a: Any, b: Any, x: Any, y: Any) -> Any:
    """Lane by lane x where a < b, else y; y where a or b is nan."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        a, b, x, y = (_as_vector(context, builder, v, k) for v, k in zip(args, signature.args, strict=True))
        return builder.select(builder.fcmp_ordered("<", a, b), x, y)

    return lanes(a, b, x, y), generate


def _exp(x):
    """2^n e^r with x = n ln 2 + r and the Taylor polynomial of e^r: below 1.5 ulp."""
    x = greatest(least(x, 1000.0), -1000.0)
    n = (x * _LOG2_E + _ROUNDING) - _ROUNDING
    r = (x - n * _LN2_HIGH) - n * _LN2_LOW
    c, s = _FACTORIALS, r * r
    q = s * s
    low = (c[2] + r * c[3]) + s * (c[4] + r * c[5])
    high = (c[6] + r * c[7]) + s * (c[8] + r * c[9]) + q * ((c[10] + r * c[11]) + s * (c[12] + r * c[13]))
    # In two factors, for results that are not normal numbers.
    half = (0.5 * n + _ROUNDING) - _ROUNDING
    return (1.0 + (r + s * (low + q * high))) * _power_of_two(half) * _power_of_two(n - half)


def _log(x):
    """n ln 2 + ln(1 + f) by fdlibm's polynomial in f / (2 + f): below 1 ulp."""
    n, m = _split(_if_less(x, _TINY, x * 2.0**54, x))
    n, f = n - _if_less(x, _TINY, 54.0, 0.0), m - 1.0
    s = f / (2.0 + f)
    z, half = s * s, 0.5 * f * f
    w = z * z
    r = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01))
    c = 2.857142874366239149e-01 + w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01)
    r = r + z * (6.666666666666735130e-01 + w * c)
    value = n * _LN2_HIGH - ((half - (s * (half + r) + n * _LN2_LOW)) - f)
    # 0 - inf is the logarithm of zero, and nan - inf is nan.
    return _if_less(0.0, x, _if_less(x, np.inf, value, x), _if_less(x, 0.0, np.nan, x - np.inf))


def _extend(function: Any, implementation: Any) -> None:
    compiled = register_jitable(implementation) if inspect.isfunction(implementation) else implementation

    # numba compares the two signatures, annotations included: neither carries any.
    @overload(function)
    def choose(a):
        return (lambda a: compiled(a)) if isinstance(a, Lanes) else None


_extend(np.sqrt, _sqrt)
_extend(np.log, _log)
_extend(np.exp, _exp)
_extend(abs, _fabs)


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
