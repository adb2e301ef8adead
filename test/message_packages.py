# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Message packages made from lists of fields, as a workspace would build them, in seconds.

The generators are in the ROS wheels. A C++ compiler turns what they write into one library; the
middleware loads it under the names of two type supports, Python as the module that rclpy asks for.
"""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

FASTRTPS, INTROSPECTION = 'rosidl_typesupport_fastrtps_c', 'rosidl_typesupport_introspection_c'
GENERATORS = ('rosidl_adapter', 'rosidl_generator_c', 'rosidl_generator_py',
              'rosidl_generator_type_description', 'rosidl_typesupport_c', FASTRTPS,
              INTROSPECTION)
RUNTIME = ('rosidl_runtime_c', 'rosidl_typesupport_c', 'fastcdr', FASTRTPS, f'{FASTRTPS}pp',
           INTROSPECTION)
COMPILERS = ('c++', 'g++', 'clang++')


def missing() -> str:
    """Return what keeps packages from being built here, empty when nothing does."""
    absent = [name for name in GENERATORS if importlib.util.find_spec(name) is None]
    if not any(map(shutil.which, COMPILERS)):
        absent.append('a C++ compiler')
    return ', '.join(absent)


def build(folder: Path, package: str, messages: Mapping[str, str], *used: str) -> None:
    """Build a package whose messages have these fields into a folder for ``PYTHONPATH``.

    The folder is a prefix for ``AMENT_PREFIX_PATH`` too: share/ has the definitions.

    Arguments
    ---------
    messages
        Name of each message, and its fields as in a .msg file.
    used
        Packages whose messages are fields, and those whose messages these have as fields.

    """
    source = folder / f'{package}.source'
    (source / 'msg').mkdir(parents=True)
    for name, fields in messages.items():
        (source / 'msg' / f'{name}.msg').write_text(fields, encoding='utf-8')
    # In a process of its own: the generators' templates replace sys.stdout, once and for all.
    given = json.dumps([str(source), package, list(messages), used])
    subprocess.run([sys.executable, __file__, given], check=True, stdout=subprocess.DEVNULL)
    _compile(source, folder / package, used)
    (folder / package / '__init__.py').touch()
    shutil.copytree(source / 'msg', folder / 'share' / package / 'msg')


def _share(package: str) -> Path:
    """Return share/PACKAGE of a ROS installation, or of the wheels."""
    prefixes = [*filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(':')), sys.prefix]
    return next(path for path in (Path(each, 'share', package) for each in prefixes)
                if path.is_dir())


def _generate(source: Path, package: str, names: list[str], used: Sequence[str]) -> None:
    """Write the sources."""
    import rosidl_typesupport_introspection_c
    from rosidl_adapter.msg import convert_msg_to_idl
    from rosidl_generator_c import generate_c
    from rosidl_generator_py import generate_py
    from rosidl_generator_type_description import generate_type_hash
    from rosidl_typesupport_c import generate_c as generate_typesupport_c
    from rosidl_typesupport_fastrtps_c import generate_typesupport_fastrtps_c

    for name in names:
        convert_msg_to_idl(source, package, Path('msg', f'{name}.msg'), source / 'msg')

    def arguments(generator: str, folder: str) -> str:
        """Return the file that tells a generator what to write."""
        path = source / f'{generator}.json'
        path.write_text(json.dumps({
            'package_name': package, 'output_dir': str(source / folder),
            'include_paths': [f'{each}:{_share(each)}' for each in used],
            'template_dir': str(_share(generator) / 'resource'), 'target_dependencies': [],
            'idl_tuples': [f'{source}:msg/{name}.idl' for name in names],
            'type_description_tuples': [f'msg/{name}.idl:{source}/types/msg/{name}.json'
                                        for name in names]}), encoding='utf-8')
        return str(path)

    generate_type_hash(arguments('rosidl_generator_type_description', 'types'))
    generate_c(arguments('rosidl_generator_c', f'c/{package}'))
    generate_typesupport_fastrtps_c(arguments(FASTRTPS, f'c/{package}'))
    generate_typesupport_c(arguments('rosidl_typesupport_c', f'c/{package}'),
                           [FASTRTPS, INTROSPECTION])
    rosidl_typesupport_introspection_c.generate_c(arguments(INTROSPECTION, f'more/{package}'))
    generate_py(arguments('rosidl_generator_py', f'../{package}'), ['rosidl_typesupport_c'])
    # One library: what it shows to others is of no weight.
    for folder, generator in (('c', 'rosidl_generator_c'), ('c', FASTRTPS),
                              ('more', INTROSPECTION)):
        path = source / folder / package / 'msg' / f'{generator}__visibility_control.h'
        path.write_text(''.join(
            f'#define {generator.upper()}_{kind}_{package}\n'
            for kind in ('PUBLIC', 'IMPORT', 'EXPORT')), encoding='utf-8')


def _compile(source: Path, home: Path, used: Sequence[str]) -> None:
    """Compile into the folder of the package."""
    import numpy as np

    prefix, package = _share('rosidl_runtime_c').parents[1], home.name
    headers = [source / 'c', source / 'more', sysconfig.get_path('include'), np.get_include(),
               prefix / 'include', *filter(Path.is_dir, (prefix / 'include').iterdir())]
    entry = home / f'_{package}_s.ep.rosidl_typesupport_c.c'
    files = [path for folder in (source / 'c', source / 'more', home / 'msg')
             for path in folder.rglob('*') if path.suffix in ('.c', '.cpp')]
    with ThreadPoolExecutor(os.cpu_count()) as compilers:
        objects = list(compilers.map(lambda path: _object(path, headers), (*files, entry)))
    others = [f'{each}__{part}' for each in used
              for part in ('rosidl_generator_c', 'rosidl_generator_py', FASTRTPS, INTROSPECTION)]
    _link(home / f'lib{package}.so', objects[:-1], [*others, *RUNTIME], prefix / 'lib')
    names = [f'{package}__{kind}' for kind in (FASTRTPS, INTROSPECTION)]
    for name in names:
        _link(home / f'lib{name}.so', [], [package], home)
    suffix = sysconfig.get_config_var('EXT_SUFFIX')
    _link(home / f'{package}_s__rosidl_typesupport_c{suffix}', objects[-1:], [package, *names],
          home)


def _object(path: Path, headers: Sequence[Path | str]) -> Path:
    """Compile one file."""
    made = path.with_suffix(f'{path.suffix}.o')
    _run('-x', 'c' if path.suffix == '.c' else 'c++', '-c', '-O0', '-fPIC', '-w',
         *(f'-I{header}' for header in headers), '-o', made, path)
    return made


def _link(library: Path, objects: Sequence[Path], needed: Sequence[str], where: Path) -> None:
    """Link a library that is found by its name once it is loaded, and what it needs beside it."""
    _run('-shared', '-o', library, f'-Wl,-soname,{library.name}', '-Wl,-rpath,$ORIGIN',
         '-Wl,--no-as-needed', *objects, f'-L{where}', *(f'-l{name}' for name in needed))


def _run(*arguments: object) -> None:
    """Run the compiler; its words are the error."""
    compiler = next(filter(None, map(shutil.which, COMPILERS)))
    done = subprocess.run([compiler, *map(str, arguments)], text=True, capture_output=True,
                          check=False)
    if done.returncode:
        raise RuntimeError(done.stderr)


if __name__ == '__main__':
    _folder, *_rest = json.loads(sys.argv[1])
    _generate(Path(_folder), *_rest)
