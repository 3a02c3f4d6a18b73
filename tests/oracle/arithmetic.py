"""Real and complex numbers of any precision: MPFR and MPC through gmpy2 where it is installed, else mpmath.

Both spell +, -, *, / and abs alike; what they spell differently is here. gmpy2's own numbers are used, not
only mpmath's gmpy2 back end, because that is several times faster.
"""

from __future__ import annotations

import math
from contextlib import AbstractContextManager
from typing import Any

import mpmath

try:
    import gmpy2
except ImportError:  # the references must run where only mpmath is installed
    gmpy2 = None

Scalar = Any
"""A real or complex number of the arithmetic in use."""


def bits(digits: int) -> int:
    """Return the binary precision for a number of decimal digits."""
    return math.ceil(digits * math.log2(10)) + 4


class MpmathArithmetic:
    """mpmath's numbers."""

    exp = staticmethod(mpmath.exp)
    sqrt = staticmethod(mpmath.sqrt)

    @staticmethod
    def precision(digits: int) -> AbstractContextManager[Any]:
        """Return a context in which the arithmetic has this many digits."""
        return mpmath.workprec(bits(digits))

    @staticmethod
    def real(value: float | str) -> Scalar:
        """Return a float exactly, a decimal string rounded to the precision."""
        return mpmath.mpf(value)

    @staticmethod
    def complex(real: Scalar, imag: Scalar) -> Scalar:
        """Return real + i imag."""
        return mpmath.mpc(real, imag)

    @staticmethod
    def pi() -> Scalar:
        """Return pi to the precision in use."""
        return +mpmath.pi

    @staticmethod
    def to_mpc(value: Scalar) -> mpmath.mpc:
        """Return the number as mpmath's, with all its digits."""
        return value if isinstance(value, mpmath.mpc) else mpmath.mpc(value)


class Gmpy2Arithmetic:
    """MPFR's and MPC's numbers, correctly rounded."""

    if gmpy2 is not None:
        exp = staticmethod(gmpy2.exp)
        sqrt = staticmethod(gmpy2.sqrt)

    @staticmethod
    def precision(digits: int) -> AbstractContextManager[Any]:
        """Return a context in which the arithmetic has this many digits."""
        return gmpy2.context(precision=bits(digits))

    @staticmethod
    def real(value: float | str) -> Scalar:
        """Return a float exactly, a decimal string rounded to the precision."""
        return gmpy2.mpfr(value)

    @staticmethod
    def complex(real: Scalar, imag: Scalar) -> Scalar:
        """Return real + i imag."""
        return gmpy2.mpc(real, imag)

    @staticmethod
    def pi() -> Scalar:
        """Return pi to the precision in use."""
        return gmpy2.const_pi()

    @staticmethod
    def to_mpc(value: Scalar) -> mpmath.mpc:
        """Return the number as mpmath's, with all its digits."""
        parts = (value.real, value.imag)
        if not all(gmpy2.is_finite(part) for part in parts):
            raise ArithmeticError(f"a value that is not finite: {value}")
        exact = [mpmath.libmp.from_man_exp(*map(int, part.as_mantissa_exp())) for part in parts]
        return mpmath.mp.make_mpc(tuple(exact))


Arithmetic = type[MpmathArithmetic] | type[Gmpy2Arithmetic]
DEFAULT: Arithmetic = MpmathArithmetic if gmpy2 is None else Gmpy2Arithmetic
