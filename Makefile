# Two commands set everything up on a machine with Python >= 3.11 (with venv) and make:
#   make benchmark   the paper's experiments beside the published numbers
#   make test        the test suite
PYTHON ?= python3
VENV   ?= .venv
OUT    ?= results/paper
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready

.PHONY: benchmark test check format speed setup clean

benchmark: $(READY)
	$(BIN)/coartic run paper --out $(OUT)

test: $(READY)
	$(BIN)/python -m pytest --numprocesses auto

check: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

format: $(READY)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

speed: $(READY)
	$(BIN)/python -m benchmarks.speed

setup: $(READY)

$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "coartic needs Python 3.11 or newer; $(PYTHON) is $$($(PYTHON) --version). Try: make PYTHON=python3.12 ..."; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch $@

clean:
	rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
