# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Package metadata and install layout, for pip and for colcon."""

from glob import glob
from pathlib import Path
from xml.etree import ElementTree as ET

# isort: off
from setuptools import find_packages, setup  # first: it replaces distutils
from distutils.command.install_data import install_data
# isort: on

NAME = 'manifold_mpc_ros'
MAINTAINER = ET.parse('package.xml').find('maintainer')
EXECUTABLES = {
    'controller': f'{NAME}.nodes.controller.main:main',
    'simulator': f'{NAME}.nodes.simulator.main:main',
    'guidance': f'{NAME}.nodes.guidance.main:main',
    'markers': f'{NAME}.nodes.markers.main:main',
    'manifold-mpc': f'{NAME}.cli.main:main',
}
# What flies: the library and the nodes.
FLIES = [
    'casadi>=3.6.5',
    'numpy>=1.26',
    'pyyaml>=6.0',
    'scipy>=1.11',
]
ROS = [
    'ros-jazzy-common-interfaces',
    'ros-jazzy-lifecycle-msgs',
    'ros-jazzy-rclpy',
    'ros-jazzy-rmw-fastrtps-cpp',
]
# The laboratory: the verbs of manifold-mpc.
LAB = [
    'matplotlib>=3.6',
    'plotly>=5.15',
    'python-flint>=0.7',
    'rich>=13',
    'rosbags>=0.11,<0.12',
]
# Heavy, and needed by one verb: campaigns write Parquet, and run on clusters if asked to.
CAMPAIGN = [*LAB, 'pyarrow>=14']
# TLEs, for guidance; Kepler's elements need nothing.
GUIDANCE = ['sgp4>=2.20']
# A C compiler for machines that have none: the solver is compiled when it is first used.
COMPILER = ['ziglang>=0.13']
CLUSTER = [*CAMPAIGN, 'distributed>=2024.1']
# Sphinx, for `make docs`.
DOCS = ['myst-parser', 'sphinx>=8.2', 'sphinxcontrib-mermaid']
TEST = [
    *GUIDANCE,
    'catkin-pkg',
    'colcon-core',
    'colcon-library-path',
    'colcon-python-setup-py',
    'colcon-recursive-crawl',
    'colcon-ros',
    'cyclonedds',
    'coverage',
    'empy==3.3.4',
    'hypothesis',
    'mcap',
    'mypy',
    'pytest<9',
    'pytest-timeout',
    'pytest-xdist',
    'ruff',
    'setuptools>=70.1,<80',
    'types-PyYAML',
]
STUB = """#!/bin/sh
# Run the command of this name that pip put into bin/ of the same prefix.
here=$(dirname "$(readlink -f "$0")")
exec "$here/../../bin/$(basename "$0")" "$@"
"""


class InstallData(install_data):
    """Install the data files, and for pip the executables that ``ros2 run`` looks for.

    colcon puts console scripts into ``lib/<package>``, pip puts them into ``bin`` and nowhere
    else. A wheel therefore carries one stub per command under ``lib/<package>``.
    """

    def run(self) -> None:
        """Install the data files, then the stubs when a wheel is being built."""
        super().run()
        if 'bdist_wheel' not in self.distribution.commands:
            return
        folder = Path(self.install_dir) / 'lib' / NAME
        self.mkpath(str(folder))
        for command in EXECUTABLES:
            stub = folder / command
            stub.write_text(STUB, encoding='utf-8')
            stub.chmod(0o755)
            self.outfiles.append(str(stub))


setup(
    name=NAME,
    version='0.1.0',
    description='Model predictive attitude control on SO(3) for ROS 2',
    license='Apache-2.0',
    author='The manifold_mpc_ros authors',
    maintainer=MAINTAINER.text,
    maintainer_email=MAINTAINER.get('email'),
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={NAME: ['py.typed', 'config/presets/*.yaml', 'lab/report/static/*',
                         'mpc/backends/*.[ch]', 'lab/export/templates/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        (f'share/{NAME}/config', sorted(glob('config/*.*'))),
        (f'share/{NAME}/config/campaigns', sorted(glob('config/campaigns/*.yaml'))),
        (f'share/{NAME}/config/scenarios', sorted(glob('config/scenarios/*.yaml'))),
        (f'share/{NAME}/config/chaos', sorted(glob('config/chaos/*.yaml'))),
        (f'share/{NAME}/config/fastdds', sorted(glob('config/fastdds/*'))),
        (f'share/{NAME}/config/sros2', sorted(glob('config/sros2/*'))),
        (f'share/{NAME}/config/systemd', sorted(glob('config/systemd/*.service'))),
        (f'share/{NAME}/launch', sorted(glob('launch/*.py'))),
    ],
    cmdclass={'install_data': InstallData},
    python_requires='>=3.10',
    install_requires=FLIES,
    extras_require={'lab': LAB, 'campaign': CAMPAIGN, 'cluster': CLUSTER, 'compiler': COMPILER,
                    'docs': DOCS, 'guidance': GUIDANCE,
                    'ros': ROS, 'test': CLUSTER + TEST},
    entry_points={'console_scripts': [f'{name} = {main}' for name, main in EXECUTABLES.items()]},
    zip_safe=False,
)
