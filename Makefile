# `make demo` and `make test` each work on a fresh machine with Python 3.11 or newer and nothing else.
# All share the virtual environment .venv, to which something is installed only when what it needs has changed.

PYTHON ?= python3
STUDY ?= all
ARGS ?=
WORKERS ?= 2

VENV := .venv
BIN := $(VENV)/bin
PINS := pyproject.toml constraints.txt
PACKAGES := piec_envs planners evaluation
# The oldest MuJoCo that pyproject.toml allows; constraints.txt has the newest.
OLDEST_MUJOCO := $(shell sed -n 's/.*"mujoco>=\([0-9.]*\),.*/\1/p' pyproject.toml)
INSTALL := $(BIN)/python -m pip install --disable-pip-version-check -c constraints.txt
# Tests of one module share what is costly to make, so that they stay with one worker; long modules begin first.
PYTEST := $(BIN)/python -m pytest -n $(WORKERS) --dist loadscope --no-loadscope-reorder --durations=15

.PHONY: help venv demo test test-fast test-all test-oldest-mujoco lint format bench sheets reproduce clean distclean
.NOTPARALLEL:

help:
	@echo "make demo       plan, disturb, and draw: a table, a picture and an animation"
	@echo "make test       run the tests; those of extras that are not installed are skipped"
	@echo "make test-fast  run those that take at most a second each"
	@echo "make test-all   install all extras and run all tests; a skipped one fails"
	@echo "make test-oldest-mujoco  run the tests of the dynamics on the oldest MuJoCo allowed"
	@echo "make lint       ruff and mypy"
	@echo "make format     let ruff rewrite the code"
	@echo "make sheets     write the page of each environment into docs/envs"
	@echo "make bench      measure the speed of kernels, environments and planners"
	@echo "make reproduce  run a study again beside results/, and compare: STUDY=planar-disturbance (default: all)"
	@echo "make venv       only install, with the development tools"
	@echo "make clean      remove build outputs and caches, those of Numba too"
	@echo "make distclean  the same, and .venv"
	@echo "PYTHON=... picks the interpreter, ARGS=... is handed on to the command, WORKERS=... (2) share the tests"

$(VENV)/made:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed: make PYTHON=python3.11")'
	$(PYTHON) -m venv --clear $(VENV)
	@touch $@

$(VENV)/base: $(VENV)/made $(PINS)
	$(INSTALL) -e .
	@touch $@

$(VENV)/dev: $(VENV)/made $(PINS)
	$(INSTALL) -e ".[dev]"
	@touch $(VENV)/base $@

$(VENV)/all: $(VENV)/made $(PINS)
	$(INSTALL) -e ".[all]"
	@touch $(VENV)/base $(VENV)/dev $@

venv: $(VENV)/dev

demo: $(VENV)/base
	$(BIN)/piec demo $(ARGS)

test: $(VENV)/dev
	$(PYTEST) $(ARGS)

test-fast: $(VENV)/dev
	$(PYTEST) -m "not slow" $(ARGS)

test-all: $(VENV)/all
	$(PYTEST) --no-skips --continue-on-collection-errors $(ARGS)

test-oldest-mujoco: $(VENV)/dev
	$(BIN)/python -m pip install --disable-pip-version-check --quiet --no-deps --upgrade --target $(VENV)/oldest \
		"mujoco~=$(OLDEST_MUJOCO).0"
	PYTHONPATH=$(VENV)/oldest $(BIN)/python -c 'import mujoco; assert mujoco.__version__.startswith("$(OLDEST_MUJOCO)."), mujoco'
	PYTHONPATH=$(VENV)/oldest $(PYTEST) tests/dynamics tests/contracts/test_dynamics.py $(ARGS)

lint: $(VENV)/dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(VENV)/dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(VENV)/dev
	$(BIN)/piec bench $(ARGS)

sheets: $(VENV)/dev
	$(BIN)/python -m piec_envs.env.sheets docs/envs

reproduce: $(VENV)/base
	$(BIN)/piec reproduce $(STUDY) $(ARGS)

clean:
	rm -rf build dist *.egg-info .pytest_cache .ruff_cache .mypy_cache .hypothesis
	find $(PACKAGES) tests benchmarks \( -name '*.nbi' -o -name '*.nbc' \) -delete
	find $(PACKAGES) tests benchmarks -type d -name __pycache__ -prune -exec rm -rf {} +

distclean: clean
	rm -rf $(VENV)
