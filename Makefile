# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
# Everything a checkout needs, in .venv: see `make help`.

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL:
.PHONY: help setup test lint types pytest test-processors test-properties coverage demo figures golden policies bench basilisk docs clean

# The first that runs; the ROS wheels are tested with 3.11. Override with PYTHON=...
PYTHON ?= $(firstword $(foreach p,python3.11 python3,$(shell $(p) -c '' 2> /dev/null && echo $(p))))
VENV := .venv
BIN := $(VENV)/bin
DEPENDENCIES := $(VENV)/.dependencies-installed
STAMP := $(VENV)/.package-installed
# Packages that `make bench` compares with and that would get in the way elsewhere.
PEERS := $(VENV)/peers
DOCS_TOOLS := $(VENV)/.docs-tools-installed
# Another simulator of spacecraft, in an environment of its own: 600 MB.
BASILISK := $(VENV)/basilisk

# Files of tests go to this many processes; every test over DDS locks a domain of its own.
TEST_WORKERS ?= 3
PYTEST_ARGS ?=
DEMO_ARGS ?=
FIGURES_ARGS ?=
BENCH_ARGS ?=
PROCESSORS_ARGS ?=
DOCS_ARGS ?=
BASILISK_ARGS ?=

# Nodes of the tests and of the demo talk on this machine only.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST

# The ROS wheels restart Python once, with a library path and this mark. Inherited from another
# environment, the path names that environment's libraries: drop both.
ifdef _ROS_WHEELS_BOOTSTRAP_COMPLETE
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE
unexport LD_LIBRARY_PATH
endif

help:  ## Show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-15s %s\n", $$1, $$2}' $(MAKEFILE_LIST)
	@echo
	@echo '  PYTHON=...       the interpreter that .venv is made from ($(PYTHON))'
	@echo '  PYTEST_ARGS=...  more arguments for pytest, likewise DEMO_ARGS, FIGURES_ARGS, BENCH_ARGS,'
	@echo '                   BASILISK_ARGS, PROCESSORS_ARGS, DOCS_ARGS'

setup: $(STAMP)  ## Create .venv and install the package with ROS 2 and the test tools

test: lint types pytest  ## Run the linter, the type checker and every test

lint: $(STAMP)  ## Run ruff
	@echo 'ruff check'
	@$(BIN)/ruff check --quiet .

types: $(STAMP)  ## Run mypy
	@echo 'mypy'
	@$(BIN)/mypy

pytest: $(STAMP)  ## Run the tests alone
	@$(BIN)/python -m pytest --timeout=300 -n $(TEST_WORKERS) --dist loadfile $(PYTEST_ARGS)

# Hours: every test once for each setting. PROCESSORS_ARGS='--settings prescott -- test/mpc'
test-processors: $(STAMP)  ## Run the tests with other processors' kernels, and on a busy machine
	@$(BIN)/python benchmarks/processors.py --workers $(TEST_WORKERS) $(PROCESSORS_ARGS)

test-properties: $(STAMP)  ## Run every property on 2,000 examples
	@PROPERTY_EXAMPLES=2000 $(BIN)/python -m pytest -n $(TEST_WORKERS) --dist loadfile \
		$$(grep -rl 'from properties import' test --include='test_*.py') $(PYTEST_ARGS)

# What decides in the nodes, and the tests of it that need no ROS.
DECIDES := manifold_mpc_ros/control/*
DECIDES_TESTS := test/control
coverage: $(STAMP)  ## Branch coverage of the mode logic and the gates; fails below 95 %
	@mkdir -p build
	@PROPERTY_EXAMPLES=20 COVERAGE_FILE=build/coverage $(BIN)/python -m coverage run --branch \
		--include='$(DECIDES)' -m pytest -q $(DECIDES_TESTS) $(PYTEST_ARGS)
	@COVERAGE_FILE=build/coverage $(BIN)/python -m coverage report --fail-under=95

demo: $(STAMP)  ## Close the loop over DDS: a 180 degree slew with two processes
	@$(BIN)/manifold-mpc demo $(DEMO_ARGS)

figures: $(STAMP)  ## Reproduce the four figures of the paper
	@$(BIN)/manifold-mpc figures $(FIGURES_ARGS)

bench: $(STAMP) $(PEERS)  ## Compare the solver with others, side by side on one core
	@$(BIN)/manifold-mpc bench $(BENCH_ARGS)

basilisk: $(STAMP) $(BASILISK)/.installed  ## Fly a spacecraft that Basilisk simulates
	@$(BIN)/python benchmarks/basilisk/measure.py $(BASILISK_ARGS)

policies: $(STAMP)  ## Write the SROS2 policies again, from what the executables declare
	@$(BIN)/python -m manifold_mpc_ros.lab.security.policies config/sros2

golden: $(STAMP)  ## Record the golden bags of the tests again
	@$(BIN)/python test/recording/record_golden.py

# A warning fails, and so does a link within the repository that leads nowhere. Links to elsewhere:
# DOCS_ARGS='-b linkcheck'
docs: $(STAMP) $(DOCS_TOOLS)  ## Build the documents and the docstrings into build/docs
	@rm -rf docs/api
	@$(BIN)/sphinx-build -q -W --keep-going -c docs $(DOCS_ARGS) . build/docs
	@echo 'build/docs/docs/index.html'

clean:  ## Remove .venv and everything that was built
	rm -rf $(VENV) docs/api build dist install log manifold_mpc_ros.egg-info
	rm -rf .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Slow, and needed only after a change of what is depended on.
$(DEPENDENCIES): setup.py .ci/constraints.txt .ci/setup
	@PYTHON='$(PYTHON)' .ci/setup $(VENV) dependencies
	@touch $@

# In a folder of its own: the wheel brings a cut-down CasADi that would replace the real one. Where
# it cannot be had the comparison goes on without it, and says so.
$(PEERS): $(DEPENDENCIES)
	@PYTHON='$(PYTHON)' .ci/setup $(VENV) peers
	@touch $@

$(BASILISK)/.installed:
	@$(PYTHON) -m venv $(BASILISK)
	@$(BASILISK)/bin/python -m pip --disable-pip-version-check --quiet install bsk==2.12.1
	@touch $@

$(DOCS_TOOLS): $(DEPENDENCIES)
	@PYTHON='$(PYTHON)' .ci/setup $(VENV) docs
	@touch $@

# Seconds: the executables in .venv run the files of this checkout again.
$(STAMP): $(DEPENDENCIES) setup.cfg pyproject.toml package.xml \
        $(wildcard resource/* config/*.* config/*/* launch/*.py) \
        $(shell find manifold_mpc_ros -name '*.py' -o -name py.typed -o -path '*/static/*' \
            -o -path '*/backends/*.[ch]')
	@PYTHON='$(PYTHON)' .ci/setup $(VENV) package
	@touch $@
