# Two commands do everything: `make run` and `make test`.  Set-up happens by itself, once.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready
QUIET  := --quiet --disable-pip-version-check

# PyTorch comes without CUDA unless asked for: make run TORCH=cu130, or TORCH=auto to find out.
# Where PyTorch keeps its wheels for CPUs, uv knows; pip is asked first, for machines that hold one.
TORCH   ?= cpu
VERSION := $(shell sed -n 's/^torch==//p' requirements.lock)
UV      := uv==0.13.9
torch_into = { [ $(TORCH) = cpu ] && \
  $(1)/python -m pip install $(QUIET) --no-deps torch==$(VERSION)+cpu 2>/dev/null; } || \
  { $(1)/python -m pip install $(QUIET) $(UV) && $(1)/uv pip install --quiet \
  --python $(1)/python --torch-backend $(TORCH) torch==$(VERSION); }

.PHONY: run test lint bench soak lock clean

run: $(READY)
	$(BIN)/swarm up deploy/library/swarms/gridworld-a.toml

test: lint
	@tests/debian-packages.sh
	$(BIN)/python -m pytest

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# The protocol under so many schedules of faults, from a seed on: make soak SCHEDULES=100000
SCHEDULES  ?= 20000
FIRST_SEED ?= 0

soak: $(READY)
	SCHEDULES=$(SCHEDULES) FIRST_SEED=$(FIRST_SEED) $(BIN)/python -m pytest -q \
	  tests/swarm/simulation/test_simulation.py -k no_schedule

bench: $(READY)
	@tests/debian-packages.sh bench
	@$(BIN)/python -m pip install $(QUIET) -r requirements-bench.lock
	$(BIN)/python -m tests.bench

$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed, this is " + sys.version.split()[0] + "; name another: make PYTHON=python3.12")'
	@echo "setting up $(VENV) (once, about two minutes)"
	@$(PYTHON) -m venv $(VENV)
	@$(call torch_into,$(BIN))
	@$(BIN)/python -m pip install $(QUIET) -r requirements.lock
	@$(BIN)/python -m pip install $(QUIET) --no-deps --no-build-isolation --editable .
	@touch $@

# After a change of the ranges in pyproject.toml: resolve again, write the exact versions down.
lock:
	rm -rf build/lock && $(PYTHON) -m venv build/lock
	$(call torch_into,build/lock/bin)
	build/lock/bin/python -m pip install $(QUIET) "setuptools>=77" ".[viewer,security,figures,onnx,dev]"
	{ echo "# Exact versions of everything; written by 'make lock'."; \
	  build/lock/bin/python -m pip freeze --all --exclude dcpg-swarm --exclude pip --exclude uv | sed 's/+cpu$$//; s/ @ .*//'; } > requirements.lock

clean:
	rm -rf $(VENV) build runs .mypy_cache .ruff_cache .pytest_cache .hypothesis *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
