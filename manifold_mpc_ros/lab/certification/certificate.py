# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The certificate of a terminal set: a file that carries a claim and all that re-proves it.

The claim is about the stored problem, P, K and level, every number of which is written so that
it reads back to the last bit. A re-check recomputes all of it from these; the stored verdicts
and figures are for the reader and are believed by nobody.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lie.arrays import Array

FORMAT = 'manifold_mpc_ros terminal set certificate'
VERSION = 1
_DIGEST = 'sha256'


@dataclass(frozen=True, eq=False)
class Certificate:
    """A claim about ``X_T = {xi^T P xi <= certified_level}`` and what supported it.

    ``problem`` and ``configuration`` describe the problem; ``design_level`` is the c that the
    controller uses, up to which the conditions beyond ``certified_level`` are sampled only.
    ``margin`` is the one of ``F(xi+) - F(xi) <= -(1 + margin) L``. ``evidence`` holds figures for
    the reader: bounds met, boxes, depth, time, why the rest is not certified.
    """

    problem: str
    configuration: dict[str, Any]
    P: Array
    K: Array
    design_level: float
    certified_level: float
    margin: float
    evidence: dict[str, Any]

    @property
    def complete(self) -> bool:
        """Whether the whole terminal set of the controller is certified."""
        return self.certified_level >= self.design_level

    def claim(self) -> str:
        """Return the claim in words."""
        if self.certified_level <= 0:
            return 'nothing is certified'
        if self.complete:
            return f'certified on all of X_T (c = {self.design_level:.6g})'
        return (f'certified up to c = {self.certified_level:.6g}, sampled between that and '
                f'{self.design_level:.6g}')

    def to_text(self) -> str:
        """Return the file's text."""
        content: dict[str, Any] = {'format': FORMAT, 'version': VERSION, 'claim': self.claim()}
        for entry in fields(self):
            value = getattr(self, entry.name)
            content[entry.name] = value.tolist() if isinstance(value, np.ndarray) else value
        content[_DIGEST] = _digest(content)
        return json.dumps(content, indent=1, allow_nan=False) + '\n'


def write_certificate(certificate: Certificate, path: Path) -> None:
    """Write a certificate to a file."""
    path.write_text(certificate.to_text(), encoding='utf-8')


def read_certificate(path: Path) -> Certificate:
    """Read a certificate.

    Raises ManifoldMpcError when the file is not a certificate of this version, or was changed
    after it was written.
    """
    try:
        content = json.loads(path.read_text(encoding='utf-8'))
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise ManifoldMpcError(f'{path} is not a certificate: {error}') from None
    if not isinstance(content, dict) or content.get('format') != FORMAT:
        raise ManifoldMpcError(f'{path} is not a certificate of a terminal set')
    if content.get('version') != VERSION:
        raise ManifoldMpcError(f'{path} has version {content.get("version")!r} of the format; '
                               f'this program reads version {VERSION}')
    if content.get(_DIGEST) != _digest(content):
        raise ManifoldMpcError(f'{path} was changed after it was written: its {_DIGEST} does not '
                               'match')
    return _from_content(content, path)


def _from_content(content: Mapping[str, Any], path: Path) -> Certificate:
    """Build a certificate, its numbers checked for kind and size."""
    try:
        P, K = (np.array(content[name], dtype=float) for name in ('P', 'K'))
        numbers = {name: float(content[name])
                   for name in ('design_level', 'certified_level', 'margin')}
        certificate = Certificate(
            problem=str(content['problem']), configuration=dict(content['configuration']),
            P=P, K=K, evidence=dict(content['evidence']), **numbers)
    except (KeyError, TypeError, ValueError) as error:
        raise ManifoldMpcError(f'{path} is not a complete certificate: {error!r}') from None
    square = P.ndim == 2 and K.ndim == 2 and P.shape == (K.shape[1],) * 2
    finite = all(np.isfinite(part).all() for part in (P, K, [*numbers.values()]))
    if not (square and finite and min(numbers.values()) >= 0):
        raise ManifoldMpcError(f'{path} is not a complete certificate: P (n, n), K (m, n), levels '
                               'and margin must be finite numbers')
    return certificate


def _digest(content: Mapping[str, Any]) -> str:
    """Return the digest of everything else in a file, whatever its layout."""
    rest = {name: value for name, value in content.items() if name != _DIGEST}
    text = json.dumps(rest, sort_keys=True, separators=(',', ':'), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
