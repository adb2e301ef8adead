# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a wheel requires, to the end, among the distributions that run the tests."""

from __future__ import annotations

from collections.abc import Iterator
from email.parser import Parser
from importlib import metadata
from pathlib import Path
from zipfile import ZipFile

from packaging.requirements import Requirement


def required_by(wheel: Path, extras: set[str]) -> set[str]:
    """Return the names of all distributions that a wheel needs with some extras."""
    with ZipFile(wheel) as archive:
        name = next(n for n in archive.namelist() if n.endswith('.dist-info/METADATA'))
        lines = Parser().parsestr(archive.read(name).decode()).get_all('Requires-Dist', [])
    found: set[str] = set()
    waiting = _needed(lines, extras)
    while waiting:
        each = waiting.pop()
        if each.name not in found:
            found.add(each.name)
            waiting += _needed(metadata.requires(each.name) or [], each.extras)
    return found


def files_of(names: set[str]) -> Iterator[metadata.PackagePath]:
    """Yield the installed files of some distributions."""
    for name in names:
        yield from (file for file in metadata.files(name) or [] if Path(file.locate()).is_file())


def _needed(lines: list[str], extras: set[str]) -> list[Requirement]:
    """Return the requirements that apply here."""
    each = [Requirement(line) for line in lines]
    return [one for one in each if one.marker is None or any(
        one.marker.evaluate({'extra': extra}) for extra in ('', *extras))]
