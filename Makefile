# `make demo` and `make test` each work on a fresh machine with Python 3.11 or newer and nothing else.
# Both share the virtual environment .venv, which is remade only when what it installs has changed.

PYTHON ?= python3
STUDY ?= all
ARGS ?=

VENV := .venv
BIN := $(VENV)/bin
PINS := pyproject.toml constraints.txt
PACKAGES := piec_envs planners evaluation
# The oldest MuJoCo that pyproject.toml allows; constraints.txt has the newest.
OLDEST_MUJOCO := $(shell sed -n 's/.*"mujoco>=\([0-9.]*\),.*/\1/p' pyproject.toml)
INSTALL := $(BIN)/python -m pip install --disable-pip-version-check -c constraints.txt

.PHONY: help venv demo test test-oldest-mujoco lint format bench reproduce clean distclean
.NOTPARALLEL:

help:
	@echo "make demo       plan, disturb, and draw: a table, a picture and an animation"
	@echo "make test       run the tests"
	@echo "make test-oldest-mujoco  run the tests of the dynamics on the oldest MuJoCo allowed"
	@echo "make lint       ruff and mypy"
	@echo "make format     let ruff rewrite the code"
	@echo "make bench      measure the speed of kernels, environments and planners"
	@echo "make reproduce  run a study again: STUDY=planar-disturbance (default: all)"
	@echo "make venv       only install, with the development tools"
	@echo "make clean      remove build outputs and caches, those of Numba too"
	@echo "make distclean  the same, and .venv"
	@echo "PYTHON=... picks the interpreter, ARGS=... is handed on to the command"

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

venv: $(VENV)/dev

demo: $(VENV)/base
	$(BIN)/piec demo $(ARGS)

test: $(VENV)/dev
	$(BIN)/python -m pytest $(ARGS)

test-oldest-mujoco: $(VENV)/dev
	$(BIN)/python -m pip install --disable-pip-version-check --quiet --no-deps --upgrade --target $(VENV)/oldest \
		"mujoco~=$(OLDEST_MUJOCO).0"
	PYTHONPATH=$(VENV)/oldest $(BIN)/python -c 'import mujoco; assert mujoco.__version__.startswith("$(OLDEST_MUJOCO)."), mujoco'
	PYTHONPATH=$(VENV)/oldest $(BIN)/python -m pytest tests/dynamics tests/contracts/test_dynamics.py $(ARGS)

lint: $(VENV)/dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(VENV)/dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(VENV)/dev
	$(BIN)/piec bench $(ARGS)

reproduce: $(VENV)/base
	$(BIN)/piec reproduce $(STUDY) $(ARGS)

clean:
	rm -rf build dist *.egg-info .pytest_cache .ruff_cache .mypy_cache .hypothesis
	find $(PACKAGES) tests benchmarks \( -name '*.nbi' -o -name '*.nbc' \) -delete
	find $(PACKAGES) tests benchmarks -type d -name __pycache__ -prune -exec rm -rf {} +

distclean: clean
	rm -rf $(VENV)
