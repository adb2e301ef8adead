# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Maps between rotations, rotation vectors, Cayley parameters and quaternions, in batches.

Every function works on the last one (vectors, quaternions) or two (matrices) dimensions and
keeps the leading ones. Rotation vectors are in radians. ``R_NB`` maps B components to N
components. Quaternions are ordered w, x, y, z here; messages order them x, y, z, w.

The logarithm never divides by the sine of the angle: it goes through the quaternion, so it
keeps its accuracy, and its length pi, on the 180 degree set.

Largest absolute errors measured for angles in [0, pi], 1e-12 to 1e-3 rad from both ends and the
switches of every formula included: exp 3.3e-15 (against a matrix exponential that has most of
it), log and angle 9e-16 (relative, below 1e-3 rad), Jacobians 2.2e-15, inverse Jacobians 6e-16,
quaternion and Cayley round trips 1.4e-15, orthogonality 1.9e-15. Shown by test_so3.py and
test_so3_jacobians.py, with a margin of two to five for other machines.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.errors import ConfigurationError, ManifoldMpcError
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.lie.coefficients import cotangent_defect, sinc, sine_defect

# |w| at or below this is rounding of an exact 180 degree rotation (3.6e-15 rad or less from it).
HALF_TURN_W = 8.0 * float(np.finfo(np.float64).eps)
# An axis component at or below this part of the largest one does not decide the axis sign.
AXIS_SIGN_SCALE = 1e-9

# The positive root of psi^4 = psi + 4.
_SPIRAL = 1.533751168755204288118041

_IDENTITY = np.eye(3)


def hat(v: ArrayLike) -> Array:
    """Map v (..., 3) to the skew matrix v^x (..., 3, 3) with v^x w = v x w, exactly."""
    v = np.asarray(v, dtype=np.float64)
    matrix = np.zeros((*v.shape[:-1], 3, 3))
    matrix[..., 2, 1] = v[..., 0]
    matrix[..., 1, 2] = -v[..., 0]
    matrix[..., 0, 2] = v[..., 1]
    matrix[..., 2, 0] = -v[..., 1]
    matrix[..., 1, 0] = v[..., 2]
    matrix[..., 0, 1] = -v[..., 2]
    return matrix


def vee(matrix: ArrayLike) -> Array:
    """Map the skew part of a matrix (..., 3, 3) to v (..., 3); inverse of `hat`."""
    a = np.asarray(matrix, dtype=np.float64)
    twice = (a[..., 2, 1] - a[..., 1, 2], a[..., 0, 2] - a[..., 2, 0], a[..., 1, 0] - a[..., 0, 1])
    return 0.5 * np.stack(twice, axis=-1)


def exp(phi: ArrayLike) -> Array:
    """Map a rotation vector phi (..., 3) [rad] to R (..., 3, 3).

    R = I + sin(t)/t phi^x + (1 - cos t)/t^2 (phi^x)^2, t = |phi|.
    """
    phi = np.asarray(phi, dtype=np.float64)
    theta = np.linalg.norm(phi, axis=-1)
    return _polynomial(phi, sinc(theta), 0.5 * sinc(0.5 * theta) ** 2)


def log(R: ArrayLike) -> Array:
    """Map R (..., 3, 3) to its rotation vector (..., 3) [rad], of length at most pi.

    phi = 2 atan2(|v|, w) v / |v| with the quaternion (w, v) of `quaternion_from_rotation`. At
    180 degrees the length is pi and the sign of the axis follows the rule stated there.
    """
    q = quaternion_from_rotation(R)
    v = q[..., 1:]
    length = np.linalg.norm(v, axis=-1)
    zero = length == 0.0
    safe = np.where(zero, 1.0, length)
    ratio = np.where(zero, 2.0, 2.0 * np.arctan2(length, q[..., 0]) / safe)
    return ratio[..., None] * v


def angle(R: ArrayLike, axis_B: Array | None = None) -> Array:
    """Map R (..., 3, 3) to its rotation angle in [0, pi] [rad], accurate at both ends.

    With a unit axis b (3,) to the angle between b and ``R^T b``: the roll about b is free.
    """
    if axis_B is not None:
        turned = np.einsum('...ji,j->...i', np.asarray(R, dtype=np.float64), axis_B)
        return np.asarray(np.arctan2(
            np.linalg.norm(np.cross(turned, axis_B), axis=-1), turned @ axis_B))
    q = quaternion_from_rotation(R)
    return 2.0 * np.arctan2(np.linalg.norm(q[..., 1:], axis=-1), q[..., 0])


def angle_beyond(phi: ArrayLike, R: ArrayLike) -> Array:
    """Map a turn phi (..., 3) and R (..., 3, 3) to |log(exp(-phi) R)| (...), in [0, pi] [rad]."""
    return angle(exp(-np.asarray(phi, dtype=np.float64)) @ np.asarray(R, dtype=np.float64))


def left_jacobian(phi: ArrayLike) -> Array:
    """Map phi (..., 3) to J_l (..., 3, 3): exp(phi + d) = exp(J_l d) exp(phi) to first order.

    J_l = I + (1 - cos t)/t^2 phi^x + (t - sin t)/t^3 (phi^x)^2.
    """
    phi = np.asarray(phi, dtype=np.float64)
    theta = np.linalg.norm(phi, axis=-1)
    return _polynomial(phi, 0.5 * sinc(0.5 * theta) ** 2, sine_defect(theta))


def right_jacobian(phi: ArrayLike) -> Array:
    """Map phi (..., 3) to J_r (..., 3, 3): exp(phi + d) = exp(phi) exp(J_r d) to first order."""
    return left_jacobian(-np.asarray(phi, dtype=np.float64))


def left_jacobian_inverse(phi: ArrayLike) -> Array:
    """Map phi (..., 3), |phi| < 2 pi, to J_l^-1 (..., 3, 3).

    J_l^-1 = I - phi^x / 2 + (1 - (t/2) cot(t/2))/t^2 (phi^x)^2.
    """
    phi = np.asarray(phi, dtype=np.float64)
    theta = np.linalg.norm(phi, axis=-1)
    return _polynomial(phi, np.full_like(theta, -0.5), cotangent_defect(theta))


def right_jacobian_inverse(phi: ArrayLike) -> Array:
    """Map phi (..., 3), |phi| < 2 pi, to J_r^-1 (..., 3, 3)."""
    return left_jacobian_inverse(-np.asarray(phi, dtype=np.float64))


def cayley(c: ArrayLike) -> Array:
    """Map c (..., 3) to the rotation by 2 atan|c| about c.

    cay(c) = (I + c^x)(I - c^x)^-1 = I + 2/(1 + |c|^2) (c^x + (c^x)^2).
    """
    c = np.asarray(c, dtype=np.float64)
    scale = 2.0 / (1.0 + np.sum(c * c, axis=-1))
    return _polynomial(c, scale, scale)


def cayley_inverse(R: ArrayLike) -> Array:
    """Map R (..., 3, 3) to c (..., 3) with cay(c) = R: c = v / w, of length tan(angle / 2).

    Raises ManifoldMpcError when a rotation is by 180 degrees: it has no Cayley parameter.
    """
    q = quaternion_from_rotation(R)
    w = q[..., :1]
    if np.any(w == 0.0):
        raise ManifoldMpcError(
            f'{np.count_nonzero(w == 0.0)} of {w.size} rotations are by 180 degrees, '
            'where the Cayley parameter does not exist'
        )
    return q[..., 1:] / w


def rotation_from_quaternion(q_wxyz: ArrayLike) -> Array:
    """Map a quaternion w, x, y, z (..., 4), of any length, to R (..., 3, 3).

    Only products of two components enter, so q and -q give the same bits.
    Raises ConfigurationError when a quaternion is zero or not finite.
    """
    q = np.asarray(q_wxyz, dtype=np.float64)
    if q.ndim == 1:
        return _one_rotation(q)
    largest = np.max(np.abs(q), axis=-1, keepdims=True)
    if not np.all((largest > 0.0) & (largest < np.inf)):
        raise ConfigurationError('q_wxyz', q_wxyz, 'a finite quaternion that is not zero')
    q = q / largest
    products = q[..., :, None] * q[..., None, :]
    scale = 2.0 / np.trace(products, axis1=-2, axis2=-1)
    v = products[..., 1:, 1:]
    squares = np.trace(v, axis1=-2, axis2=-1)
    increment = v + hat(products[..., 0, 1:]) - squares[..., None, None] * _IDENTITY
    return _IDENTITY + scale[..., None, None] * increment


def _one_rotation(q_wxyz: Array) -> Array:
    """Map one quaternion (4,) to R (3, 3), with the bits of the general case.

    A node does this once per state, and array operations on so few numbers would take it longer.
    """
    w, x, y, z = q_wxyz.tolist()
    largest = max(map(abs, (w, x, y, z)))
    if not 0.0 < largest < math.inf or math.isnan(w + x + y + z):
        raise ConfigurationError('q_wxyz', q_wxyz, 'a finite quaternion that is not zero')
    w, x, y, z = w / largest, x / largest, y / largest, z / largest
    xx, yy, zz = x * x, y * y, z * z
    scale = 2.0 / (w * w + xx + yy + zz)
    squares = xx + yy + zz
    xy, xz, yz, wx, wy, wz = x * y, x * z, y * z, w * x, w * y, w * z
    return np.array([
        [1.0 + scale * (xx - squares), 0.0 + scale * (xy - wz), 0.0 + scale * (xz + wy)],
        [0.0 + scale * (xy + wz), 1.0 + scale * (yy - squares), 0.0 + scale * (yz - wx)],
        [0.0 + scale * (xz - wy), 0.0 + scale * (yz + wx), 1.0 + scale * (zz - squares)]])


def quaternion_from_rotation(R: ArrayLike) -> Array:
    """Map R (..., 3, 3) to its unit quaternion w, x, y, z (..., 4) with w >= 0.

    The row of 4 q q^T with the largest diagonal entry, normalised: small components keep their
    relative accuracy. A w within rounding of 0 (HALF_TURN_W) is set to 0, and then the first
    component of the axis above AXIS_SIGN_SCALE of the largest one is made positive, so that a
    half turn has one quaternion whatever the rounding.
    """
    outer = _outer_quaternion(np.asarray(R, dtype=np.float64))
    row = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(outer, row[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    half_turn = np.abs(q[..., 0]) <= HALF_TURN_W
    v = q[..., 1:]
    size = np.abs(v)
    decides = size > AXIS_SIGN_SCALE * np.max(size, axis=-1, keepdims=True)
    first = np.take_along_axis(v, np.argmax(decides, axis=-1)[..., None], axis=-1)[..., 0]
    negative = np.where(half_turn, first, q[..., 0]) < 0.0
    q = np.where(negative[..., None], -q, q)
    q[..., 0] = np.where(half_turn, 0.0, q[..., 0])
    return q


def attitude_error_B(R_ND: ArrayLike, R_NB: ArrayLike) -> Array:
    """Return R_DB = R_ND^T R_NB (..., 3, 3), the attitude of B seen from the desired frame D."""
    R_DN = np.swapaxes(np.asarray(R_ND, dtype=np.float64), -1, -2)
    return R_DN @ np.asarray(R_NB, dtype=np.float64)


def random_rotations(rng: np.random.Generator, n: int) -> Array:
    """Return n rotations (n, 3, 3), uniform on SO(3)."""
    return rotation_from_quaternion(rng.standard_normal((n, 4)))


def spiral_rotations(n: int) -> Array:
    """Return n rotations (n, 3, 3) spread evenly over SO(3), the same every time.

    Super-Fibonacci spirals: two circles of the unit quaternions, turned at the irrational rates
    ``1/sqrt 2`` and ``1/psi``, ``psi^4 = psi + 4``, the squared radii going from 0 to 1.
    """
    s = np.arange(n) + 0.5
    first, second = np.sqrt(s / n), np.sqrt(1.0 - s / n)
    a, b = 2.0 * np.pi * s / np.sqrt(2.0), 2.0 * np.pi * s / _SPIRAL
    return rotation_from_quaternion(np.stack(
        [first * np.sin(a), first * np.cos(a), second * np.sin(b), second * np.cos(b)], axis=-1))


def project(matrix: ArrayLike) -> Array:
    """Return the rotation nearest to a matrix (..., 3, 3) in the Frobenius norm.

    U diag(1, 1, det(U V^T)) V^T of the singular value decomposition U S V^T.
    """
    u, _, vt = np.linalg.svd(np.asarray(matrix, dtype=np.float64))
    u = np.array(u)
    u[..., :, 2] *= np.sign(np.linalg.det(u @ vt))[..., None]
    return u @ vt


def is_rotation(R: ArrayLike, tolerance: float = 1e-9) -> bool:
    """Say whether every R (..., 3, 3) has max|R^T R - I| <= tolerance and det R > 0."""
    R = np.asarray(R, dtype=np.float64)
    defect = np.abs(np.swapaxes(R, -1, -2) @ R - _IDENTITY)
    return bool(np.all(defect <= tolerance) and np.all(np.linalg.det(R) > 0.0))


def _polynomial(phi: Array, first: Array, second: Array) -> Array:
    """Return I + first phi^x + second (phi^x)^2."""
    outer = phi[..., :, None] * phi[..., None, :]
    squared = np.sum(phi * phi, axis=-1)
    square = outer - squared[..., None, None] * _IDENTITY
    return _IDENTITY + first[..., None, None] * hat(phi) + second[..., None, None] * square


def _outer_quaternion(R: Array) -> Array:
    """Return 4 q q^T (..., 4, 4) of the quaternion of R (..., 3, 3)."""
    trace = np.trace(R, axis1=-2, axis2=-1)
    outer = np.empty((*R.shape[:-2], 4, 4))
    outer[..., 0, 0] = 1.0 + trace
    outer[..., 0, 1:] = outer[..., 1:, 0] = 2.0 * vee(R)
    outer[..., 1:, 1:] = R + np.swapaxes(R, -1, -2) + (1.0 - trace)[..., None, None] * _IDENTITY
    return outer
