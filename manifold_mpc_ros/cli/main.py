# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command ``manifold-mpc``: one verb for each thing that can be asked for."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence
from types import ModuleType
from typing import Any, NoReturn

from manifold_mpc_ros.cli.extras import require
from manifold_mpc_ros.cli.verbs import VERBS
from manifold_mpc_ros.errors import ManifoldMpcError, missing_package

PROGRAM = 'manifold-mpc'

EXIT_SUCCESS = 0
EXIT_NOT_ACHIEVED = 1
EXIT_MISTAKE = 2
EXIT_INTERRUPTED = 130

_DESCRIPTION = 'Model predictive attitude control on SO(3), without ROS and over it.'
_EPILOG = f"""exit status:
  {EXIT_SUCCESS}  the thing asked for succeeded
  {EXIT_NOT_ACHIEVED}  it ran and did not succeed (the attitude did not settle, ...)
  {EXIT_MISTAKE}  it could not run: a mistake in the command or in a file, said in one line"""


class _OneLineParser(argparse.ArgumentParser):
    """A parser whose complaints are one line."""

    def error(self, message: str) -> NoReturn:
        """Print what is wrong and where help is, and leave."""
        self.exit(EXIT_MISTAKE, f'{self.prog}: error: {message} (see {self.prog} --help)\n')


class _ShowVersion(argparse.Action):
    """Print the installed version; looked up only when asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        """Print and leave."""
        import importlib.metadata
        try:
            version = importlib.metadata.version('manifold_mpc_ros')
        except importlib.metadata.PackageNotFoundError:
            version = '(source tree, not installed)'
        print(f'{PROGRAM} {version}')
        parser.exit(EXIT_SUCCESS)


def module_of(verb: str) -> ModuleType:
    """Return the module of a verb."""
    return importlib.import_module(f'manifold_mpc_ros.lab.{VERBS[verb].module}')


class _VerbParser(_OneLineParser):
    """The parser of one verb, which gets its arguments when it is given some to parse."""

    def parse_known_args(self, *arguments: Any, **named: Any) -> Any:
        """Add the arguments of the verb, then parse."""
        module = module_of(self.prog.split()[-1])
        self.epilog = f'examples:\n{module.EXAMPLES}'
        module.add_arguments(self)
        self.set_defaults(run=module.run)
        return super().parse_known_args(*arguments, **named)


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command line."""
    parser = _OneLineParser(
        prog=PROGRAM, description=_DESCRIPTION, epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--version', action=_ShowVersion, nargs=0, help='print the version')
    verbs = parser.add_subparsers(
        dest='verb', metavar='VERB', required=True, title='verbs', parser_class=_VerbParser)
    for name, verb in VERBS.items():
        verbs.add_parser(
            name, help=verb.summary, description=verb.summary,
            formatter_class=argparse.RawDescriptionHelpFormatter)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status; see `_EPILOG` for what it means."""
    try:
        parsed = build_parser().parse_args(arguments)
        require(parsed.verb, *VERBS[parsed.verb].packages)
        status = int(parsed.run(parsed))
        sys.stdout.flush()
    except ManifoldMpcError as error:
        return _complain(' '.join(str(error).split()))
    except ModuleNotFoundError as error:
        if not (missing := missing_package(error)):
            raise
        return _complain(missing)
    except BrokenPipeError:
        # The reader of our output has left; the interpreter's own last flush must not fail.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_NOT_ACHIEVED
    except OSError as error:
        where = f'{error.filename}: ' if error.filename else ''
        return _complain(f'{where}{error.strerror or error}')
    except KeyboardInterrupt:
        print(f'{PROGRAM}: interrupted', file=sys.stderr)
        return EXIT_INTERRUPTED
    return status


def _complain(message: str) -> int:
    """Print a mistake as one line."""
    print(f'{PROGRAM}: error: {message}', file=sys.stderr)
    return EXIT_MISTAKE


if __name__ == '__main__':
    sys.exit(main())
