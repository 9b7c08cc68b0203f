"""Elementary functions for kernels, in the working precision `R` (`numpy.float32` or `float64`).

Each function takes `R` first and an argument that is already of that type. The float64 versions
call `math` or sum a series to rounding. The float32 versions are polynomials without a function
call, so that LLVM can vectorise the loop around them (numba's wheels come without a vector libm).
The polynomials are minimax fits made for this file. The error bounds in the docstrings are for
float32 over the stated range, and are tested against float64. NaN is passed through.
"""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

import numpy as np
from numba import jit, njit, types
from numba.extending import overload, register_jitable

from fabricusd.kernels.internals import use_internals


def _compiler() -> Any:
    """The compiler for functions that only kernels call."""
    if use_internals():
        with suppress(ImportError, AttributeError):
            from fabricusd.kernels.parts import PartCompiler

            return PartCompiler
    from numba.core.compiler import Compiler

    return Compiler


PartCompiler = _compiler()

# Callers count NaN and infinity, so these must be preserved; other arithmetic may be reordered. In
# numpy's error model a division by zero gives infinity; an exception would prevent vectorisation.
KERNEL: dict[str, Any] = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc", "arcp", "nsz"},
    "no_cfunc_wrapper": True,
}
# For kernels that allocate no array: numba then counts no references. In a function that passes a
# compiled fabric to another one, counting references to its arrays took five times as long as the
# work itself.
LEAN: dict[str, Any] = {**KERNEL, "_nrt": False}
# PART is for functions that only kernels call, INLINE for those of them that are always inlined.
PART: dict[str, Any] = {**LEAN, "cache": False, "pipeline_class": PartCompiler}
INLINE: dict[str, Any] = {**PART, "forceinline": True}


def as_part(kernel: Any) -> Any:
    """A second version of `kernel`, for other kernels to call."""
    return jit(**{**kernel.targetoptions, "cache": False, "pipeline_class": PartCompiler})(
        kernel.py_func
    )


# These functions allow fused multiply-add only: reordering would undo the two-part range reductions
# below.
_EXACT: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": {"contract"},
    "forceinline": True,
    "pipeline_class": PartCompiler,
}
_inner = register_jitable(**_EXACT)

BLOCK = 256
"""Entries that the vectorised loops over directions process at a time: their intermediate results
stay in the first-level cache."""


@njit(**INLINE)
def index(begin, k):
    """`begin + k` as an array index; both must be at least 0.

    For a signed index numba tests at every step whether it counts from the array's end, and LLVM
    then does not vectorise the loop.
    """
    return np.uintp(begin) + np.uintp(k)


@njit(**INLINE)
def whole(n):
    """`n`, an index or a count in [0, 2^32), in a form that tells LLVM it is not negative.

    Use it at the head of a kernel for loop bounds, and for indices read from memory: numba's test
    for a negative index is then resolved at compile time.
    """
    return np.int64(np.uint32(n))


_LOG2_HIGH, _LOG2_LOW = 0.693359375, -2.12194440e-4
_HALF_PI_HIGH, _HALF_PI_MIDDLE, _HALF_PI_LOW = 1.5703125, 4.83751297e-4, 7.54978942e-8


def exp(R, x):
    """e^x. Relative error below 2e-7 for -87 <= x <= 88; below that it falls to 0."""
    return R(math.exp(x))


def log(R, x):
    """Natural logarithm of a normal number x > 0. Error below 2e-7 relative or 1e-7 absolute."""
    return R(math.log(x))


def sin(R, x):
    """Sine. Absolute error below 2e-7 for |x| <= 100."""
    return R(math.sin(x))


def cos(R, x):
    """Cosine. Absolute error below 2e-7 for |x| <= 100."""
    return R(math.cos(x))


def atan2(R, y, x):
    """Angle of (x, y) in [-pi, pi], 0 at the origin. Relative error below 4e-7."""
    return R(math.atan2(y, x))


def asin(R, x):
    """Arc sine, x clamped to [-1, 1]. Relative error below 4e-7."""
    return R(math.asin(min(1.0, max(-1.0, x))))


def acos(R, x):
    """Arc cosine, x clamped to [-1, 1]. Absolute error below 4e-7, relative near 1."""
    return R(math.acos(min(1.0, max(-1.0, x))))


def erf(R, x):
    """The error function. Absolute error below 2e-7, relative below 4e-7."""
    return R(math.erf(x))


def erfinv(R, x):
    """Inverse of erf, x clamped just inside (-1, 1). erf(erfinv(x)) equals x within 5e-7."""
    return R(_erfinv64(R, float(x)))


def i0e(R, x):
    """e^-x I0(x), the scaled modified Bessel function, x >= 0. Relative error below 4e-7."""
    return R(_i0e64(R, float(x)))


@_inner
def _unless_nan(x, value):
    """`value`, or NaN if `x` is NaN: min and max inside a polynomial may have dropped the NaN."""
    return value if x == x else x


@_inner
def _exp32(R, x):
    clamped = min(max(x, np.float32(-87.3)), np.float32(88.7))
    k = np.floor(clamped * np.float32(1.44269504) + np.float32(0.5))
    r = clamped - k * np.float32(_LOG2_HIGH)
    r = r - k * np.float32(_LOG2_LOW)
    p = np.float32(0.00836888243) + r * np.float32(0.00139504768)
    p = np.float32(0.166665189) + r * (np.float32(0.041666206) + r * p)
    p = np.float32(1) + r * (np.float32(1) + r * (np.float32(0.5) + r * p))
    # The exponent field is built in floating point, which is exact because k + 127 is below 2^24.
    scale = np.int32((k + np.float32(127)) * np.float32(8388608)).view(np.float32)
    return _unless_nan(x, np.float32(0) if x < np.float32(-87.3) else p * scale)


@_inner
def _log32(R, x):
    bits = np.float32(x).view(np.int32)
    # Centre the mantissa on 1: [sqrt(1/2), sqrt 2).
    shift = np.int32((bits - np.int32(0x3F3504F3)) >> np.int32(23))
    f = np.int32(bits - np.int32(shift << np.int32(23))).view(np.float32) - np.float32(1)
    k = np.float32(shift)
    p = np.float32(0.127615503) + f * np.float32(-0.0763442984)
    p = np.float32(0.142017625) + f * (np.float32(-0.131601951) + f * p)
    p = np.float32(0.200012267) + f * (np.float32(-0.166233565) + f * p)
    p = np.float32(0.333333317) + f * (np.float32(-0.250008211) + f * p)
    tail = f * f * (f * p - np.float32(0.5)) + k * np.float32(_LOG2_LOW)
    return _unless_nan(x, f + tail + k * np.float32(_LOG2_HIGH))


@_inner
def _quarter_turns(x):
    """x = k pi/2 + r with |r| <= pi/4."""
    k = np.floor(x * np.float32(0.636619772) + np.float32(0.5))
    r = x - k * np.float32(_HALF_PI_HIGH)
    r = r - k * np.float32(_HALF_PI_MIDDLE)
    return k, r - k * np.float32(_HALF_PI_LOW)


@_inner
def _sine_of_turn(k, r):
    """sin(k pi/2 + r) for whole k and |r| <= pi/4."""
    z = r * r
    s = np.float32(0.00833217814) + z * np.float32(-0.000195172979)
    s = r + r * z * (np.float32(-0.166666549) + z * s)
    c = np.float32(-0.00138873675) + z * np.float32(2.44384498e-05)
    c = np.float32(1) + z * (np.float32(-0.5) + z * (np.float32(0.0416666469) + z * c))
    odd = k - np.float32(2) * np.floor(np.float32(0.5) * k)
    half = np.floor(np.float32(0.5) * k)
    turned = half - np.float32(2) * np.floor(np.float32(0.5) * half)
    return (np.float32(1) - np.float32(2) * turned) * (c if odd > np.float32(0.5) else s)


@_inner
def _sin32(R, x):
    k, r = _quarter_turns(x)
    return _sine_of_turn(k, r)


@_inner
def _cos32(R, x):
    k, r = _quarter_turns(x)
    return _sine_of_turn(k + np.float32(1), r)


@_inner
def _atan2_32(R, y, x):
    a, b = abs(x), abs(y)
    low, high = (a, b) if a < b else (b, a)
    # The lower bound on the denominator makes the angle of the origin 0 without a branch.
    t = low / max(high, np.float32(1e-37))
    z = t * t
    p = np.float32(-0.0162828691) + z * np.float32(0.00290351746)
    p = np.float32(-0.0753365739) + z * (np.float32(0.0430391445) + z * p)
    p = np.float32(-0.142071315) + z * (np.float32(0.106546688) + z * p)
    p = np.float32(-0.333330939) + z * (np.float32(0.199930538) + z * p)
    angle = t + t * z * p
    angle = np.float32(1.57079633) - angle if a < b else angle
    angle = np.float32(3.14159265) - angle if x < np.float32(0) else angle
    return _unless_nan(x + y, math.copysign(angle, y))


@_inner
def _asin32(R, x):
    c = min(max(x, np.float32(-1)), np.float32(1))
    square = (np.float32(1) - c) * (np.float32(1) + c)
    return _unless_nan(x, _atan2_32(R, c, math.sqrt(square)))


@_inner
def _acos32(R, x):
    c = min(max(x, np.float32(-1)), np.float32(1))
    square = (np.float32(1) - c) * (np.float32(1) + c)
    return _unless_nan(x, _atan2_32(R, math.sqrt(square), c))


@_inner
def _erf32(R, x):
    a = abs(x)
    z = a * a
    p = np.float32(-0.000802084128) + z * np.float32(7.88911952e-05)
    p = np.float32(-0.0268544446) + z * (np.float32(0.00518953534) + z * p)
    p = np.float32(-0.376126271) + z * (np.float32(0.112836002) + z * p)
    near = a * (np.float32(1.12837917) + z * p)
    b = min(a, np.float32(4))
    p = np.float32(-0.000441336377) + b * np.float32(2.16868499e-05)
    p = np.float32(-0.0252082567) + b * (np.float32(0.00420456187) + b * p)
    p = np.float32(0.633219893) + b * (np.float32(0.108418577) + b * p)
    p = np.float32(-0.000188040226) + b * (np.float32(1.12957842) + b * p)
    far = np.float32(1) - _exp32(R, -p)
    return _unless_nan(x, math.copysign(near if a < np.float32(1) else far, x))


@_inner
def _erfinv32(R, x):
    c = min(max(x, np.float32(-0.99999994)), np.float32(0.99999994))
    # [Giles2012]: in this variable, erfinv(x)/x is smooth enough for two polynomials.
    w = -_log32(R, (np.float32(1) - c) * (np.float32(1) + c))
    v = min(w, np.float32(5))
    p = np.float32(2.16469083e-07) + v * np.float32(-8.59043191e-09)
    p = np.float32(3.76091661e-06) + v * (np.float32(-1.93315315e-06) + v * p)
    p = np.float32(-0.000128664661) + v * (np.float32(4.52327205e-05) + v * p)
    p = np.float32(0.011548052) + v * (np.float32(-0.00233311017) + v * p)
    near = np.float32(0.886226916) + v * (np.float32(0.232013938) + v * p)
    s = math.sqrt(max(w, np.float32(5)))
    p = np.float32(0.00420908992) + s * np.float32(-0.000146121679)
    p = np.float32(0.348802058) + s * (np.float32(-0.0515422502) + s * p)
    p = np.float32(3.44084241) + s * (np.float32(-1.4131891) + s * p)
    far = np.float32(2.5678598) + s * (np.float32(-3.67447228) + s * p)
    return _unless_nan(x, c * (near if w < np.float32(5) else far))


@_inner
def _erfinv64(R, x):
    c = min(max(x, -1.0 + 1.2e-16), 1.0 - 1.2e-16)
    a = abs(c)
    tail = -math.log(0.5 * math.sqrt(math.pi) * (1.0 - min(a, 1.0 - 1.2e-16)))
    far = math.sqrt(max(tail - 0.5 * math.log(max(tail, 1.0)), 0.0))
    y = float(_erfinv32(np.float32, np.float32(a))) if a < 0.99999 else far
    # Halley iterations on erfc, which keeps its relative precision where erf is nearly 1.
    for _ in range(4):
        error = (1.0 - a) - math.erfc(y)
        step = error * 0.5 * math.sqrt(math.pi) * math.exp(y * y)
        y -= step / (1.0 + y * step)
    return _unless_nan(x, math.copysign(y, c))


@_inner
def _i0e32(R, x):
    near_x = min(x, np.float32(6))
    z = near_x * near_x
    p = np.float32(2.07498059e-12) + z * np.float32(1.45854529e-14)
    p = np.float32(6.76279675e-08) + z * (np.float32(4.81476738e-10) + z * p)
    p = np.float32(0.000434017505) + z * (np.float32(6.78359057e-06) + z * p)
    p = np.float32(0.249999977) + z * (np.float32(0.015625026) + z * p)
    near = (np.float32(1) + z * p) * _exp32(R, -near_x)
    t = np.float32(1) / max(x, np.float32(6))
    p = np.float32(-0.0722954579) + t * np.float32(0.572700066)
    p = np.float32(0.0276126165) + t * (np.float32(0.0402138482) + t * p)
    p = np.float32(0.398942266) + t * (np.float32(0.0498739974) + t * p)
    far = p * math.sqrt(t)
    return _unless_nan(x, near if x < np.float32(6) else far)


@_inner
def _i0e64(R, x):
    if x < 25.0:
        # The sum of (x^2/4)^k/k!^2; every term is positive, so nothing cancels.
        quarter = 0.25 * x * x
        term = total = 1.0
        for k in range(1, 80):
            term *= quarter / (k * k)
            total += term
        return total * math.exp(-x)
    # The asymptotic series, truncated where its terms are smallest: e^-2x at x = 25.
    term = total = 1.0
    for k in range(1, 30):
        term *= (2.0 * k - 1.0) * (2.0 * k - 1.0) / (8.0 * k * x)
        total += term
    return total / math.sqrt(2.0 * math.pi * x)


@_inner
def _exp64(R, x):
    return math.exp(x)


@_inner
def _log64(R, x):
    return math.log(x)


@_inner
def _sin64(R, x):
    return math.sin(x)


@_inner
def _cos64(R, x):
    return math.cos(x)


@_inner
def _asin64(R, x):
    return _unless_nan(x, math.asin(min(1.0, max(-1.0, x))))


@_inner
def _acos64(R, x):
    return _unless_nan(x, math.acos(min(1.0, max(-1.0, x))))


@_inner
def _erf64(R, x):
    return math.erf(x)


@_inner
def _atan2_64(R, y, x):
    return math.atan2(y, x)


def _compile_by_precision(face: Any, single: Any, double: Any) -> None:
    """Make `face(R, x)` compile to `single` if R is float32, else to `double`."""

    def choose(R, x):
        return single if R.instance_type == types.float32 else double

    overload(face, jit_options=_EXACT)(choose)


for _face, _single, _double in (
    (exp, _exp32, _exp64),
    (log, _log32, _log64),
    (sin, _sin32, _sin64),
    (cos, _cos32, _cos64),
    (asin, _asin32, _asin64),
    (acos, _acos32, _acos64),
    (erf, _erf32, _erf64),
    (erfinv, _erfinv32, _erfinv64),
    (i0e, _i0e32, _i0e64),
):
    _compile_by_precision(_face, _single, _double)


@overload(atan2, jit_options=_EXACT)
def _choose_atan2(R, y, x):
    return _atan2_32 if R.instance_type == types.float32 else _atan2_64
