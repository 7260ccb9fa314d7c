# Two commands set everything up on a machine with Python >= 3.11 (with venv) and make:
#   make benchmark   the paper's experiments and all methods beside them, then the report
#   make test        the test suite
# make docs builds the site into build/docs.
# make benchmark FULL=1 also searches and proves the optima and moves the goals (suites
# optimum and locus), each with its report.
PYTHON ?= python3
VENV   ?= .venv
OUT    ?= results
FULL   ?=
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready
SUITES := paper comparison $(if $(FULL),optimum locus)

.PHONY: benchmark test check format docs speed example setup clean

benchmark: $(READY)
	@for suite in $(SUITES); do \
	  $(BIN)/coartic run $$suite --out $(OUT)/$$suite || exit; \
	done
	@for suite in $(filter-out paper,$(SUITES)); do \
	  $(BIN)/coartic report $(OUT)/$$suite || exit; \
	done
	@echo "Look at $(OUT)/comparison/report/report.html, and at $(OUT)/paper/comparison.md."
# Bytecode is kept, even where the environment says no: each worker, and each process that a
# test starts, would compile all sources anew.
test: $(READY)
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest --numprocesses auto --dist worksteal

check: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

format: $(READY)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# Notebooks are run, warnings are errors, and what pages link to is there.
docs: $(VENV)/.docs
	PATH="$(abspath $(BIN)):$$PATH" $(BIN)/python -m sphinx -q -W --keep-going -d build/doctrees \
	  docs build/docs
	$(BIN)/python docs/check_links.py build/docs
	@echo "Look at build/docs/index.html."

speed: $(READY)
	$(BIN)/python -m coartic.benchmarks.speed

example: $(READY)  # the report in the repository, of what make benchmark left
	$(BIN)/coartic report $(OUT)/comparison --out benchmarks/example --formats svg
	$(BIN)/python docs/paper_numbers.py

setup: $(READY)

$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "coartic needs Python 3.11 or newer; $(PYTHON) is $$($(PYTHON) --version). Try: make PYTHON=python3.12 ..."; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch $@

$(VENV)/.docs: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[docs]'
	@touch $@

clean:
	rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
