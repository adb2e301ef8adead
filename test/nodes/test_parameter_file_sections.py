# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node whose parameter file is for another namespace says which sections there are, and ends."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import yaml

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from harness import CONFIG, log_line

if TYPE_CHECKING:
    from harness import Rig


def file_for(folder: Path, section: str) -> Path:
    """Return the controller's shipped file under another key, and a file of somebody else's."""
    (content,) = yaml.safe_load(
        (CONFIG / 'controller.yaml').read_text(encoding='utf-8')).values()
    path = folder / 'sections.yaml'
    path.write_text(yaml.safe_dump({
        section: content, 'log_bridge': {'ros__parameters': {'exclude_nodes': []}}}),
        encoding='utf-8')
    return path


@pytest.mark.parametrize(('section', 'namespace'), [
    ('/sat1/attitude_controller', ''), ('/*/attitude_controller', ''),
    ('attitude_controller', '/sat1'), ('/sat1/attitude_controller', '/sat1/gnc'),
    ('/**/other_controller', ''),
])
def test_no_section_is_for_the_node(
    rig: Rig, tmp_path: Path, section: str, namespace: str,
) -> None:
    process = rig.start('controller', file=file_for(tmp_path, section),
                        remap={'__ns': namespace} if namespace else {})
    assert process.wait() == 1
    (line,) = process.log.strip().splitlines()
    assert '/' + section.lstrip('/') in line
    assert f"'{namespace}/attitude_controller'" in line


@pytest.mark.parametrize(('section', 'namespace'), [
    ('/sat1/attitude_controller', '/sat1'), ('/*/attitude_controller', '/sat1'),
    ('/**', '/sat1/gnc')])
def test_a_section_is_for_the_node(
    rig: Rig, tmp_path: Path, section: str, namespace: str,
) -> None:
    process = rig.start('controller', file=file_for(tmp_path, section),
                        remap={'__ns': namespace})
    rig.until(log_line(process, 'configuring'), 'the node is configured')
    assert 'the full name of this node' not in process.log


def test_one_of_two_files_has_no_section(rig: Rig, tmp_path: Path) -> None:
    """As when launch adds a file of its own to a file for somebody else."""
    path = file_for(tmp_path, '/sat1/attitude_controller')
    process = rig.run(['manifold_mpc_ros.nodes.controller.main', '--ros-args', '--params-file',
                       str(CONFIG / 'controller.yaml'), '--params-file', str(path)])
    rig.until(log_line(process, 'configuring'), 'the node is configured')
    assert process.log.count(f"{path}: ['/sat1/attitude_controller', '/log_bridge']") == 1
