# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What setup.py, package.xml and the wheel say agrees with each other and with the imports."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from email.message import Message
from email.parser import Parser
from pathlib import Path
from zipfile import ZipFile

import pytest
from catkin_pkg.package import Package, parse_package
from installed import BUILD, PIP, TOP, run

from manifold_mpc_ros.cli.extras import EXTRAS

# What an import belongs to for pip, where the names differ.
PIP_NAME = {'yaml': 'pyyaml', 'flint': 'python-flint'}
# A release takes no rosdep key that pip installs; these have no other, or none at all.
PIP_ALONE = {'casadi', 'flint', 'plotly', 'rosbags'}
# Folders of the package that are the laboratory; the rest of it flies.
LABORATORY = ('cli', 'lab')
# Declared for the launch file and for lifecycle clients, which no module of ours imports.
UNSEEN = {'launch', 'launch_ros', 'lifecycle_msgs'}


@pytest.fixture(scope='module')
def manifest() -> Package:
    return parse_package(str(TOP))


@pytest.fixture(scope='module')
def metadata(wheel: Path) -> Message:
    with ZipFile(wheel) as archive:
        name = next(n for n in archive.namelist() if n.endswith('.dist-info/METADATA'))
        return Parser().parsestr(archive.read(name).decode())


#: Imported where it is needed, and named with its extra where it is missing.
OPTIONAL = {'sgp4'}


def imported(*folders: str) -> Iterator[str]:
    """Yield the first name of each absolute import in the folders' files."""
    for path in (p for folder in folders for p in (TOP / folder).rglob('*.py')):
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(node, ast.Import):
                yield from (alias.name.partition('.')[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and not node.level:
                yield str(node.module).partition('.')[0]


def required(metadata: Message, extra: str | None = None) -> set[str]:
    """Return the lower-case names that the wheel requires, for an extra or always."""
    lines = [line for line in metadata.get_all('Requires-Dist', [])
             if (f'extra == "{extra}"' in line if extra else 'extra ==' not in line)]
    return {re.split(r'[\s;<>=!~\[(]', line)[0].lower() for line in lines}


def test_one_name_version_and_licence(manifest: Package, metadata: Message) -> None:
    assert manifest.name == metadata['Name'].replace('-', '_') == 'manifold_mpc_ros'
    assert manifest.version == metadata['Version']
    assert manifest.licenses == [metadata['License'] or metadata['License-Expression']]
    assert 'Apache License' in (TOP / 'LICENSE').read_text(encoding='utf-8')


def test_the_manifest_is_valid(manifest: Package) -> None:
    warnings: list[str] = []
    manifest.validate(warnings=warnings)
    assert warnings == []
    assert manifest.get_build_type() == 'ament_python'
    keys = [*manifest.exec_depends, *manifest.test_depends]
    assert not [depend.name for depend in keys if 'pip' in depend.name]  # bloom refuses them


def folders(laboratory: bool) -> list[str]:
    """Return the folders of the laboratory, or those of what flies."""
    package = TOP / 'manifold_mpc_ros'
    return [f'manifold_mpc_ros/{path.name}' for path in package.iterdir()
            if path.is_dir() and (path.name in LABORATORY) == laboratory]


def test_every_import_of_what_flies_is_declared_for_pip_and_for_rosdep(
        manifest: Package, metadata: Message) -> None:
    foreign = set(imported(*folders(laboratory=False), 'launch')) - sys.stdlib_module_names
    foreign -= {'manifold_mpc_ros', *OPTIONAL}
    declared = {depend.name for depend in manifest.exec_depends}
    from_ros, from_pip = foreign & declared, foreign - declared
    assert {'rclpy', 'nav_msgs', 'geometry_msgs', 'sensor_msgs'} <= from_ros
    assert {PIP_NAME.get(name, name) for name in from_pip} == required(metadata)
    keys = {f'python3-{name}' for name in from_pip - PIP_ALONE}
    assert declared - UNSEEN == keys | from_ros - UNSEEN


def test_every_import_of_the_laboratory_is_in_an_extra(
        manifest: Package, metadata: Message) -> None:
    """With those of what flies; for rosdep they are what the tests need."""
    foreign = set(imported(*folders(laboratory=True))) - sys.stdlib_module_names
    flies = {'manifold_mpc_ros', *imported(*folders(laboratory=False))}
    more = {'matplotlib' if name == 'mpl_toolkits' else name for name in foreign - flies}
    assert more | {'rclpy'} == set(EXTRAS)
    for name, extra in EXTRAS.items():
        if name != 'rclpy':
            assert PIP_NAME.get(name, name) in required(metadata, extra)
            assert PIP_NAME.get(name, name) not in required(metadata)
    assert required(metadata, 'lab') <= required(metadata, 'campaign')
    assert required(metadata, 'campaign') <= required(metadata, 'cluster')
    assert required(metadata, 'cluster') <= required(metadata, 'test')
    keys = {f'python3-{name}' for name, extra in EXTRAS.items()
            if extra == 'lab' and name not in PIP_ALONE}
    assert keys <= {depend.name for depend in manifest.test_depends}


def test_the_extras(metadata: Message) -> None:
    assert required(metadata, 'guidance') == OPTIONAL <= required(metadata, 'test')
    assert required(metadata, 'ros') == {
        'ros-jazzy-common-interfaces', 'ros-jazzy-lifecycle-msgs', 'ros-jazzy-rclpy',
        'ros-jazzy-rmw-fastrtps-cpp'}
    assert {'pytest', 'hypothesis', 'ruff', 'mypy'} <= required(metadata, 'test')
    assert metadata['Requires-Python'] == '>=3.10'


def test_the_wheel_holds_the_package_and_executable_stubs(wheel: Path) -> None:
    with ZipFile(wheel) as archive:
        modes = {entry.filename: entry.external_attr >> 16 for entry in archive.infolist()}
    top = {name.partition('/')[0] for name in modes}
    assert {name.partition('-')[0] for name in top} == {'manifold_mpc_ros'}
    sources = {p.relative_to(TOP).as_posix() for p in (TOP / 'manifold_mpc_ros').rglob('*.py')}
    assert {n for n in modes if n.startswith('manifold_mpc_ros/') and n.endswith('.py')} == sources
    stubs = {Path(name).name: mode for name, mode in modes.items()
             if '.data/data/lib/manifold_mpc_ros/' in name}
    assert set(stubs) == {'controller', 'guidance', 'simulator', 'markers', 'manifold-mpc'}
    assert all(mode & 0o111 == 0o111 for mode in stubs.values())


def test_the_source_archive_builds_the_same_wheel(
        checkout: Path, wheel: Path, tmp_path: Path) -> None:
    build = 'import sys, setuptools.build_meta as b; b.build_sdist(sys.argv[1])'
    run([sys.executable, '-c', build, tmp_path], cwd=checkout)
    archive = next(tmp_path.glob('*.tar.gz'))
    run([*PIP, 'wheel', *BUILD, '--wheel-dir', tmp_path, archive], cwd=tmp_path)
    with ZipFile(wheel) as one, ZipFile(next(tmp_path.glob('*.whl'))) as other:
        assert sorted(one.namelist()) == sorted(other.namelist())
