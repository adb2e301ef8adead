# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Mutation testing of what decides in the nodes: each small mistake has to make a test fail.

One mutant at a time: a comparison, a Boolean operator, a sign, a number, a condition or a whole
assignment or call is changed; its unit tests (not the drawn properties, so a mutant that lives
here may still be found by them) run in a forked process, and have to fail.

    .venv/bin/python benchmarks/mutation.py --output docs/results/mutation.json
"""

from __future__ import annotations

import argparse
import ast
import copy
import json
import os
import signal
import sys
import types
from collections.abc import Iterator
from pathlib import Path

import pytest

TOP = Path(__file__).parents[1]
SUITES = {
    'manifold_mpc_ros/control/modes.py': [
        'test/control/test_modes.py', 'test/control/test_held_plan.py'],
    'manifold_mpc_ros/control/output_gate.py': ['test/control/test_output.py'],
    'manifold_mpc_ros/control/input_gate.py': ['test/control/test_gate.py'],
}
UNIT_TESTS = ('not Histories and not whatever and not direction_is_kept and not no_step_is '
              'and not nearest_to')
#: A mutant whose tests take longer than this has made them hang [s].
PATIENCE_S = 60
LOADED = ('numpy', 'hypothesis', 'hypothesis.stateful', 'manifold_mpc_ros.lie.so3',
          'manifold_mpc_ros.config.control_law')

COMPARISONS = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In}
OPERATORS = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}


def changes(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Yield a word and a changed copy for each mistake that can be made in a node."""
    other = copy.deepcopy(node)
    if isinstance(other, ast.Compare):
        for index, operator in enumerate(other.ops):
            one = copy.deepcopy(other)
            one.ops[index] = COMPARISONS[type(operator)]()
            yield 'comparison', one
    elif isinstance(other, ast.BoolOp):
        other.op = ast.Or() if isinstance(other.op, ast.And) else ast.And()
        yield 'and/or', other
    elif isinstance(other, ast.UnaryOp) and isinstance(other.op, (ast.Not, ast.USub)):
        yield 'sign', other.operand
    elif isinstance(other, (ast.BinOp, ast.AugAssign)) and type(other.op) in OPERATORS:
        other.op = OPERATORS[type(other.op)]()
        yield 'operator', other
    elif isinstance(other, ast.Constant) and isinstance(other.value, (bool, int, float)):
        other.value = not other.value if isinstance(other.value, bool) else other.value + 1
        yield 'constant', other
    elif _acts(other):
        yield 'left out', ast.Pass()


def _acts(node: ast.AST) -> bool:
    """Whether a statement calls something or sets an attribute: it can be left out."""
    if isinstance(node, (ast.Assign, ast.AnnAssign)):
        target = node.targets[0] if isinstance(node, ast.Assign) else node.target
        return isinstance(target, ast.Attribute)
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)


class Place(ast.NodeTransformer):
    """Puts a changed node in the place of the n-th one, in the order of visiting."""

    def __init__(self, number: int, changed: ast.AST) -> None:
        """Count from 0."""
        self._left, self._changed = number, changed

    def visit(self, node: ast.AST) -> ast.AST:
        """Replace the node whose turn it is."""
        self._left -= 1
        if self._left == -1:
            return ast.copy_location(self._changed, node)
        return self.generic_visit(node)


def visited(tree: ast.AST) -> list[ast.AST]:
    """Return the nodes in the order in which `Place` visits them."""
    nodes: list[ast.AST] = []

    class Order(ast.NodeTransformer):
        def visit(self, node: ast.AST) -> ast.AST:
            nodes.append(node)
            return self.generic_visit(node)

    Order().visit(tree)
    return nodes


def mutants(source: str) -> Iterator[tuple[int, str, ast.AST]]:
    """Yield line, kind and tree of every mutant of a module; decorators decide nothing."""
    tree = ast.parse(source)
    decorators = {id(part) for node in ast.walk(tree)
                  for decorator in getattr(node, 'decorator_list', [])
                  for part in ast.walk(decorator)}
    for number, node in enumerate(visited(tree)):
        if id(node) in decorators:
            continue
        for kind, changed in changes(node):
            mutant = Place(number, changed).visit(copy.deepcopy(tree))
            yield getattr(node, 'lineno', 0), kind, ast.fix_missing_locations(mutant)


def survives(path: str, tree: ast.AST) -> bool:
    """Return whether every test of a module passes with the mutant in its place."""
    child = os.fork()
    if child:
        _, status = os.waitpid(child, 0)
        return status == 0
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(1, 2)
    signal.alarm(PATIENCE_S)
    try:
        name = path.removesuffix('.py').replace('/', '.')
        module = types.ModuleType(name)
        module.__file__ = str(TOP / path)
        sys.modules[name] = module
        exec(compile(tree, path, 'exec'), module.__dict__)  # noqa: S102  (a mutant of our own)
        status = pytest.main(['-x', '-q', '-p', 'no:cacheprovider', '-k', UNIT_TESTS,
                              *(str(TOP / suite) for suite in SUITES[path])])
    except BaseException:  # noqa: BLE001  (a mutant that does not even load is found)
        status = 1
    os._exit(int(status != 0))


def main() -> int:
    """Run every mutant; write and print the score."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--output', type=Path, help='JSON file for the result')
    arguments = parser.parse_args()
    os.chdir(TOP)
    sys.path.insert(0, str(TOP / 'test'))
    for name in LOADED:
        __import__(name)
    result = {}
    for path in SUITES:
        source = (TOP / path).read_text(encoding='utf-8')
        if not survives(path, ast.parse(source)):
            raise SystemExit(f'{path}: its tests fail without any change')
        alive, count = [], 0
        for line, kind, tree in mutants(source):
            count += 1
            if survives(path, tree):
                alive.append({'line': line, 'kind': kind,
                              'source': source.splitlines()[line - 1].strip()})
            print(f'\r{path}: {count} mutants, {len(alive)} alive', end='', flush=True)
        print()
        result[path] = {'mutants': count, 'found': count - len(alive), 'alive': alive}
    total = sum(each['mutants'] for each in result.values())
    found = sum(each['found'] for each in result.values())
    print(f'{found} of {total} mutants found ({100.0 * found / total:.1f} %)')
    if arguments.output:
        arguments.output.write_text(json.dumps({
            'command': 'benchmarks/mutation.py', 'score': found / total, 'modules': result,
        }, indent=1) + '\n', encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
