# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The formulas of the implicit LGVI step, written out in scalars.

A vector is a tuple of three entries, a matrix a tuple of three rows. An entry is anything that
has + - * /: a Python float (one body, without array overhead), a numpy array with one entry a
body (a batch), or a CasADi scalar (a compiled or differentiated step). There is one copy of each
formula, and one body of a batch gets the bits that it would get alone.
"""

from __future__ import annotations

from typing import Any, TypeAlias

Scalar: TypeAlias = Any
Vector: TypeAlias = tuple[Scalar, Scalar, Scalar]
Matrix: TypeAlias = tuple[Vector, Vector, Vector]


def add(a: Vector, b: Vector, scale: Scalar = 1.0) -> Vector:
    """Return a + scale b."""
    a0, a1, a2 = a
    b0, b1, b2 = b
    return a0 + scale * b0, a1 + scale * b1, a2 + scale * b2


def dot(a: Vector, b: Vector) -> Scalar:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    a0, a1, a2 = a
    b0, b1, b2 = b
    return a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0


def apply(matrix: Matrix, v: Vector) -> Vector:
    """Return the product matrix v."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    x, y, z = v
    return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z


def apply_transposed(matrix: Matrix, v: Vector) -> Vector:
    """Return the product matrix^T v."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    x, y, z = v
    return a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z


def transpose(matrix: Matrix) -> Matrix:
    """Return matrix^T."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    return (a, d, g), (b, e, h), (c, f, i)


def multiply(a: Matrix, b: Matrix) -> Matrix:
    """Return the product a b."""
    columns = transpose(b)
    return apply(columns, a[0]), apply(columns, a[1]), apply(columns, a[2])


def solve(matrix: Matrix, v: Vector) -> Vector:
    """Return matrix^-1 v by cofactors of the rows."""
    first, second, third = matrix
    columns = cross(second, third), cross(third, first), cross(first, second)
    x, y, z = apply_transposed(columns, v)
    determinant = dot(first, columns[0])
    return x / determinant, y / determinant, z / determinant


def cayley_residual(c: Vector, m: Vector, J: Matrix) -> Vector:
    """Return m + m x c + (c . m) c - 2 J c, zero when f = cay(c) solves f J_d - J_d f^T = m^x."""
    Jc = apply(J, c)
    return add(add(add(m, cross(m, c)), c, dot(c, m)), Jc, -2.0)


def newton_step(c: Vector, m: Vector, J: Matrix) -> Vector:
    """Return the Newton step of `cayley_residual` at c; at c = 0 it is (2 J - m^x)^-1 m."""
    return solve(minus_jacobian(c, m, J), cayley_residual(c, m, J))


def minus_jacobian(c: Vector, m: Vector, J: Matrix) -> Matrix:
    """Return minus the Jacobian of `cayley_residual`, 2 J - m^x - (c . m) I - c m^T."""
    c0, c1, c2 = c
    m0, m1, m2 = m
    (J00, J01, J02), (J10, J11, J12), (J20, J21, J22) = J
    along = c0 * m0 + c1 * m1 + c2 * m2
    return (
        (2.0 * J00 - along - c0 * m0, 2.0 * J01 + m2 - c0 * m1, 2.0 * J02 - m1 - c0 * m2),
        (2.0 * J10 - m2 - c1 * m0, 2.0 * J11 - along - c1 * m1, 2.0 * J12 + m0 - c1 * m2),
        (2.0 * J20 + m1 - c2 * m0, 2.0 * J21 - m0 - c2 * m1, 2.0 * J22 - along - c2 * m2),
    )


def momentum_from_cayley(c: Vector, J: Matrix) -> Vector:
    """Return m = 2 (J c + c x J c) / (1 + |c|^2), the exact inverse of the implicit equation."""
    Jc = apply(J, c)
    v = add(Jc, cross(c, Jc))
    scale = 2.0 / (1.0 + dot(c, c))
    return scale * v[0], scale * v[1], scale * v[2]


def rotation_increment(c: Vector) -> Matrix:
    """Return cay(c) - I = 2/(1 + |c|^2) (c^x + (c^x)^2), relatively accurate for small c."""
    c0, c1, c2 = c
    s00, s11, s22 = c0 * c0, c1 * c1, c2 * c2
    s01, s02, s12 = c0 * c1, c0 * c2, c1 * c2
    scale = 2.0 / (1.0 + s00 + s11 + s22)
    return (
        (-scale * (s11 + s22), scale * (s01 - c2), scale * (s02 + c1)),
        (scale * (s01 + c2), -scale * (s00 + s22), scale * (s12 - c0)),
        (scale * (s02 - c1), scale * (s12 + c0), -scale * (s00 + s11)),
    )


def add_increment(R: Matrix, G: Matrix) -> Matrix:
    """Return R (I + G), the attitude after a step f = I + G."""
    product = multiply(R, G)
    return add(R[0], product[0]), add(R[1], product[1]), add(R[2], product[2])


def renormalised(R: Matrix) -> Matrix:
    """Return R + R (I - R^T R)/2, one Newton step of the polar decomposition.

    An orthogonality error e becomes 3/4 e^2: rounding errors stay what they are in one step.
    """
    columns = transpose(R)
    d01, d02 = -0.5 * dot(columns[0], columns[1]), -0.5 * dot(columns[0], columns[2])
    d12 = -0.5 * dot(columns[1], columns[2])
    d00, d11, d22 = (0.5 - 0.5 * dot(column, column) for column in columns)
    return add_increment(R, ((d00, d01, d02), (d01, d11, d12), (d02, d12, d22)))


def within_guard(m: Vector, J: Matrix) -> Scalar:
    """Say whether |m| is below the smallest eigenvalue of J: J - |m| I positive definite.

    By the leading minors, so no eigenvalue is computed; false where an entry is NaN.
    """
    size = dot(m, m) ** 0.5
    shifted: Matrix = (
        (J[0][0] - size, J[0][1], J[0][2]),
        (J[1][0], J[1][1] - size, J[1][2]),
        (J[2][0], J[2][1], J[2][2] - size),
    )
    corner = cross(shifted[0], shifted[1])
    return (shifted[0][0] > 0.0) & (corner[2] > 0.0) & (dot(corner, shifted[2]) > 0.0)
