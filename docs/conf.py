# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sphinx: the pages of the repository and the docstrings, by ``make docs``."""

import re

from sphinx.application import Sphinx

project = 'manifold_mpc_ros'
author = 'The manifold_mpc_ros authors'
extensions = ['myst_parser', 'sphinx.ext.apidoc', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon',
              'sphinxcontrib.mermaid']
# The source folder is the repository: pages link to its files as they do anywhere else.
root_doc = 'docs/index'
include_patterns = ['*.md', 'docs/**']
exclude_patterns = ['build', '.*']
myst_heading_anchors = 4
myst_fence_as_directive = ['mermaid']
apidoc_modules = [{
    'path': '../manifold_mpc_ros', 'destination': 'docs/api', 'module_first': True}]
# The public names are on the pages of their modules, once.
autodoc_default_options = {'ignore-module-all': True}
napoleon_use_ivar = True
# A short name that several modules have leads to one of them.
suppress_warnings = ['ref.python']

OUTSIDE_LITERALS = re.compile(r'(``.*?``)|\|')


def keep_bars(_app: Sphinx, _what: str, _name: str, _object: object, _options: object,
              lines: list[str]) -> None:
    """Take ``|x|`` in a docstring for a norm, where Sphinx would look for a substitution."""
    lines[:] = [OUTSIDE_LITERALS.sub(lambda found: found[1] or r'\|', line) for line in lines]


def setup(app: Sphinx) -> None:
    """Read docstrings as they are meant."""
    app.connect('autodoc-process-docstring', keep_bars)
