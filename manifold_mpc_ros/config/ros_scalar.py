# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The value that ROS makes of one scalar of a parameter file (rcl_yaml_param_parser).

ROS asks in this order: a word of YAML 1.1 for true or false, an integer as C's ``strtoll`` reads
it with base 0, a number as ``strtod`` reads it, or else text. So ``08`` is 8.0, ``010`` is 8,
``inf`` is a number, and ``1_0``, ``null``, a date and a number that no double can hold are text.
``test/config/test_as_ros_reads.py`` compares with a real node.
"""

from __future__ import annotations

import re
import sys
from decimal import Decimal
from fractions import Fraction

Scalar = bool | int | float | str

_TRUE = ('Y', 'y', 'yes', 'Yes', 'YES', 'true', 'True', 'TRUE', 'on', 'On', 'ON')
_FALSE = ('N', 'n', 'no', 'No', 'NO', 'false', 'False', 'FALSE', 'off', 'Off', 'OFF')
#: Digits of 2**63 in base 8; a longer integer is a double.
_LONGEST = 22
_BLANK = ' \t\n\v\f\r'
_INTEGER = re.compile(r'[+-]?(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)')
_DECIMAL = re.compile(r'[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?')
_HEXADECIMAL = re.compile(
    r'[+-]?0[xX]([0-9a-fA-F]+\.?[0-9a-fA-F]*|\.[0-9a-fA-F]+)([pP][+-]?[0-9]+)?')
_NO_NUMBER = re.compile(r'[+-]?(inf(inity)?|nan(\([0-9a-zA-Z_]*\))?)', re.IGNORECASE)
_YAML_NO_NUMBER = re.compile(r'[+-]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)')


def ros_scalar(text: str, *, plain: bool) -> Scalar:
    """Return the value of a scalar; ``plain`` says that it is neither quoted nor tagged as text.

    Text ends at a null character, as it does in C.
    """
    text = text.partition('\0')[0]
    if not plain:
        return text
    if text in _TRUE or text in _FALSE:
        return text in _TRUE
    digits = text.lstrip(_BLANK)
    if _INTEGER.fullmatch(digits) and len(digits.lstrip('+-0xX')) <= _LONGEST:
        value = int(digits, 8 if re.match('[+-]?0[0-7]', digits) else 0)
        if -2**63 <= value < 2**63:
            return value
    number = _number(text, digits)
    return text if number is None else number


def _number(text: str, digits: str) -> float | None:
    """Return what ``strtod`` reads from all of the text, None where it is no double."""
    if _YAML_NO_NUMBER.fullmatch(text):
        return float(text.replace('.', ''))
    if _NO_NUMBER.fullmatch(digits):
        return float(digits.partition('(')[0])
    if _DECIMAL.fullmatch(digits):
        value, mantissa = float(digits), re.split('[eE]', digits)[0]
    elif _HEXADECIMAL.fullmatch(digits):
        try:
            value = float.fromhex(digits)
        except OverflowError:
            return None
        mantissa = re.split('[pP]', digits.lower().replace('0x', '', 1))[0]
    else:
        return None
    if abs(value) > sys.float_info.max:
        return None
    if abs(value) > sys.float_info.min or not mantissa.strip('+-0.'):
        return value
    return None if value == 0.0 or _loses_digits(value, _exact(digits)) else value


def _loses_digits(value: float, exact: Fraction) -> bool:
    """Whether a number below the normal doubles is rounded, which ``strtod`` refuses to do."""
    tiny = abs(float(exact * 2**64)) < sys.float_info.min * 2**64
    return tiny and exact != Fraction(value)


def _exact(digits: str) -> Fraction:
    """Return the number without rounding."""
    if 'x' not in digits.lower():
        return Fraction(Decimal(digits))
    mantissa, _, exponent = digits.lower().replace('0x', '', 1).partition('p')
    whole, _, part = mantissa.partition('.')
    return Fraction(int(whole + part, 16)) * Fraction(2) ** (int(exponent or 0) - 4 * len(part))
