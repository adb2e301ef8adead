# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rules that every file of the repository keeps: licence header, length, syntax, no leftovers."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
import yaml

TOP = Path(__file__).parents[2]
HEADER = ['Copyright 2026 The manifold_mpc_ros authors', 'SPDX-License-Identifier: Apache-2.0']
MAX_LINES = 300
OLDEST_PYTHON = (3, 10)

FOLDERS = ('.ci', 'benchmarks', 'config', 'docs', 'launch', 'manifold_mpc_ros', 'resource', 'test')
TEXT = {'', '.cfg', '.in', '.md', '.py', '.sh', '.toml', '.txt', '.xml', '.yaml'}

# Written so that this file does not match its own patterns.
HOME = re.compile(r'(?<![\w.])/(?:home|root|Users)/[\w.]+')
LEFTOVER = re.compile(r'^(?:<{7}|>{7}) |\b(?:TOD[O]|FIXM[E]|XX[X])\b', re.MULTILINE)


def files(suffixes: set[str]) -> list[Path]:
    """Return the repository's own files with one of the suffixes, built ones left out."""
    found = [p for p in TOP.iterdir() if p.is_file() and p.name != '.git']
    for folder in FOLDERS:
        found += [p for p in (TOP / folder).rglob('*') if p.is_file()]
    return sorted(p for p in found if p.suffix in suffixes and '__pycache__' not in p.parts)


def text(path: Path) -> str:
    """Return the file's text, which must be UTF-8."""
    return path.read_text(encoding='utf-8')


def name(path: Path) -> str:
    """Return the path as it stands in the repository."""
    return path.relative_to(TOP).as_posix()


PYTHON = files({'.py'})
SCRIPTS = [TOP / 'Makefile', TOP / '.ci/run', TOP / '.ci/setup']
YAML = files({'.yaml'})


def test_there_are_files_to_check() -> None:
    assert len(PYTHON) > 30
    assert {'config/controller.yaml', 'config/simulator.yaml'} <= set(map(name, YAML))


def test_licence_header() -> None:
    def header(path: Path) -> list[str]:
        lines = [line.lstrip('# ') for line in text(path).splitlines()[:3]]
        return lines[1:] if lines[:1] and lines[0].startswith('!') else lines[:2]
    assert [name(p) for p in [*PYTHON, *SCRIPTS, *YAML] if header(p) != HEADER] == []


def test_length() -> None:
    lengths = {name(p): len(text(p).splitlines()) for p in [*PYTHON, *SCRIPTS]}
    assert {path: lines for path, lines in lengths.items() if lines > MAX_LINES} == {}


def test_syntax_of_the_oldest_python() -> None:
    for path in PYTHON:
        ast.parse(text(path), name(path), feature_version=OLDEST_PYTHON)


def test_newer_syntax_is_found() -> None:
    with pytest.raises(SyntaxError):
        ast.parse('try:\n    pass\nexcept* OSError:\n    pass', feature_version=OLDEST_PYTHON)


def test_yaml_parses() -> None:
    for path in YAML:
        assert isinstance(yaml.safe_load(text(path)), dict), name(path)


def test_no_machine_paths_and_no_leftovers() -> None:
    found = {name(p): match.group() for pattern in (HOME, LEFTOVER) for p in files(TEXT)
             for match in pattern.finditer(text(p))}
    assert found == {}


@pytest.mark.parametrize(('pattern', 'line'), [
    (HOME, 'cache = "/{}/.cache"'.format('root')),
    (HOME, 'see /{}/somebody/notes'.format('home')),
    (LEFTOVER, '# {}O: later'.format('TOD')),
    (LEFTOVER, 'x = 1\n{} HEAD'.format('<' * 7)),
])
def test_they_are_found(pattern: re.Pattern[str], line: str) -> None:
    assert pattern.search(line)
