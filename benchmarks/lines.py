# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Count the lines of the package: what flies, folder by folder, the command line, the laboratory.

    python benchmarks/lines.py [--commit NAME ...] [--output docs/results/lines.json]

Of the working tree, and of commits that are named, as git has them. ``lines`` are those of the
files; ``docstrings``, ``comments`` (licence included), ``blank`` and ``imports`` are parts of
them, and ``code`` is the rest. Sources in C are a part of their own. In commits before e229e26 the
laboratory had no folder of its own: there all of it counts as what flies.
"""

from __future__ import annotations

import argparse
import ast
import json
import re
import subprocess
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent
PACKAGE = 'manifold_mpc_ros'
RESULT = TOP / 'docs' / 'results' / 'lines.json'
SUFFIXES = ('.py', '.c', '.h')
#: Comments that stand on lines of their own.
COMMENT = re.compile(r'^[ \t]*(?:/\*.*?\*/|//[^\n]*)[ \t]*$', re.DOTALL | re.MULTILINE)
#: Folders that are not part of what flies.
OTHERS = {'lab': 'laboratory', 'cli': 'command line'}
COMMITS = ('63bbe4a', 'e229e26', '87722c2')


def counted(source: str) -> Counter[str]:
    """Return the kinds of lines of a file."""
    tree, lines = ast.parse(source), source.splitlines()
    docstrings = sum(
        node.body[0].end_lineno - node.body[0].lineno + 1 for node in ast.walk(tree)
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef))
        and ast.get_docstring(node, clean=False) is not None)
    imports = sum(node.end_lineno - node.lineno + 1 for node in tree.body
                  if isinstance(node, (ast.Import, ast.ImportFrom)))
    comments = sum(line.lstrip().startswith('#') for line in lines)
    blank = sum(not line.strip() for line in lines) - sum(
        not line for node in ast.walk(tree)
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef))
        for line in (ast.get_docstring(node) or '').split('\n')[:-1])
    return Counter(
        files=1, lines=len(lines), docstrings=docstrings, comments=comments, blank=blank,
        imports=imports, code=len(lines) - docstrings - comments - blank - imports)


def counted_c(source: str) -> Counter[str]:
    """Return the kinds of lines of a file in C."""
    lines = [line.strip() for line in source.splitlines()]
    comments = sum(len(each.splitlines()) for each in COMMENT.findall(source))
    blank = sum(not line for line in lines)
    imports = sum(line.startswith('#include') for line in lines)
    return Counter(files=1, lines=len(lines), docstrings=0, comments=comments, blank=blank,
                   imports=imports, code=len(lines) - comments - blank - imports)


def sources(commit: str | None) -> Iterator[tuple[str, str]]:
    """Yield path below the package and text of each source, of a commit or the working tree."""
    if commit is None:
        for path in sorted(path for path in (TOP / PACKAGE).rglob('*') if path.suffix in SUFFIXES):
            yield path.relative_to(TOP / PACKAGE).as_posix(), path.read_text(encoding='utf-8')
        return
    listed = _git('ls-tree', '-r', '--name-only', commit, PACKAGE).splitlines()
    for name in sorted(name for name in listed if name.endswith(SUFFIXES)):
        yield name.removeprefix(f'{PACKAGE}/'), _git('show', f'{commit}:{name}')


def _git(*arguments: str) -> str:
    """Return what git says."""
    return subprocess.run(['git', *arguments], cwd=TOP, check=True, text=True,
                          capture_output=True).stdout


def figures(commit: str | None) -> dict[str, dict[str, int]]:
    """Return the kinds of lines of each part, and of each folder of what flies."""
    found: dict[str, Counter[str]] = {}
    for path, source in sources(commit):
        first = path.partition('/')[0]
        part = OTHERS.get(first, 'what flies')
        python = path.endswith('.py')
        part += '' if python else ', in C'
        kinds = counted(source) if python else counted_c(source)
        parts = [part] if first in OTHERS or not python else [
            part, f'{part}: {path.rpartition("/")[0] or "."}']
        for name in parts:
            found.setdefault(name, Counter()).update(kinds)
    return {name: dict(found[name]) for name in sorted(found)}


def main() -> int:
    """Count and write; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--commit', nargs='*', default=COMMITS, help='commits to compare with')
    parser.add_argument('--output', type=Path, default=RESULT)
    arguments = parser.parse_args()
    result = {'now': figures(None), **{commit: figures(commit) for commit in arguments.commit}}
    for commit, parts in result.items():
        print(f'{commit}: ' + ', '.join(
            f'{name} {kinds["lines"]} (code {kinds["code"]})' for name, kinds in parts.items()
            if ':' not in name))
    arguments.output.write_text(json.dumps(result, indent=1) + '\n', encoding='utf-8')
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
