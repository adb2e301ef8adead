# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Verdicts as JUnit XML: a suite for each bag, a case for each limit."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

if TYPE_CHECKING:
    from manifold_mpc_ros.lab.recording.bags.verdict import Verdict

#: What XML 1.0 has no character for.
_NO_XML = re.compile('[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]')


@dataclass(frozen=True)
class Suite:
    """One bag: its verdict, or the error that kept it from having one."""

    name: str
    verdict: Verdict | None = None
    error: str = ''


def write_junit(path: Path, suites: Sequence[Suite]) -> None:
    """Write the file; missing folders are made."""
    root = ET.Element('testsuites', name='manifold-mpc check')
    for suite in suites:
        _add(root, suite)
    for name in ('tests', 'failures', 'errors'):
        root.set(name, str(sum(int(each.get(name, '0')) for each in root)))
    ET.indent(root)
    path.parent.mkdir(parents=True, exist_ok=True)
    ET.ElementTree(root).write(path, encoding='utf-8', xml_declaration=True)


def _add(root: ET.Element, suite: Suite) -> None:
    """Add one suite."""
    judgements = suite.verdict.judgements if suite.verdict is not None else ()
    element = ET.SubElement(
        root, 'testsuite', name=_clean(suite.name), tests=str(len(judgements) or 1),
        failures=str(sum(not each.passed for each in judgements)),
        errors=str(int(suite.verdict is None)))
    for each in judgements:
        case = ET.SubElement(
            element, 'testcase', classname=_clean(suite.name), name=each.name)
        text = _clean(f'{each.name}: {each.measured} (limit {each.limit})')
        if each.passed:
            ET.SubElement(case, 'system-out').text = text
        else:
            ET.SubElement(case, 'failure', message=text)
    if suite.verdict is None:
        case = ET.SubElement(
            element, 'testcase', classname=_clean(suite.name), name='bag')
        ET.SubElement(case, 'error', message=_clean(suite.error))


def _clean(text: str) -> str:
    """Return text without characters that XML has not."""
    return _NO_XML.sub('?', text)
