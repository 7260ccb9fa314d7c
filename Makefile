# Two commands set everything up on a machine with Python >= 3.11 (with venv) and make:
#   make benchmark   the paper's experiments, all methods, the report and the replication
#   make test        the test suite
# make benchmark FULL=1 adds the ablations. make docs builds the site.
PYTHON ?= python3
VENV   ?= .venv
OUT    ?= results
FULL   ?=
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready
SUITES := comparison $(if $(FULL),ablations)
STUDY  := PYTHONPATH=studies $(BIN)/python

.PHONY: benchmark test check format docs shipped shipped-check speed release-check setup clean

benchmark: $(READY)
	@for suite in $(SUITES); do \
	  $(BIN)/coartic run $$suite --out $(OUT)/$$suite && \
	  $(BIN)/coartic report $(OUT)/$$suite || exit; \
	done
	$(STUDY) studies/replication/study.py $(SUITES:%=$(OUT)/%) --out $(OUT)/replication
	@$(BIN)/python docs/scripts/check_readme.py $(OUT)/comparison
	@echo "Look at $(OUT)/comparison/report/report.html and $(OUT)/replication/page.html."

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

# Notebooks are run, and warnings are errors: also of a link to what is not there.
docs: $(VENV)/.docs
	PATH="$(abspath $(BIN)):$$PATH" $(BIN)/python -m sphinx -q -W --keep-going -d build/doctrees \
	  docs build/docs
	@echo "Look at build/docs/index.html."

speed: $(READY)
	OPENBLAS_NUM_THREADS=1 $(BIN)/python docs/scripts/speed.py

# The wheel and the source distribution of the last commit, each run in an empty environment, by
# each Python of this machine; what is not tried is named.
release-check: CHECKED := --release
release-check: shipped-check
	COARTIC_PACKAGES=1 $(BIN)/python -m pytest -rs tests/test_packages.py tests/test_versions.py \
	  tests/test_families.py

# Shipped runs, performed again: one of each cell of the comparison, and of each method on each family.
shipped-check: $(READY)
	$(BIN)/python docs/scripts/check_shipped.py $(CHECKED)

# The results that are shipped, anew, by the present code: packed where they are as before. With
# CHANGED=1 also where they are not.
shipped: $(READY)
	$(BIN)/coartic run comparison --out $(OUT)/shipped/comparison
	$(BIN)/coartic run families --out $(OUT)/shipped/families
	$(BIN)/python docs/scripts/pack_shipped.py $(if $(CHANGED),--changed) \
	  $(OUT)/shipped/comparison $(OUT)/shipped/families

setup: $(READY)

$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "coartic needs Python 3.11 or newer; $(PYTHON) is $$($(PYTHON) --version). Try: make PYTHON=python3.12 ..."; exit 1; }
	@test -d coartic/benchmarks || \
	  { echo "This checkout has no symbolic links. Install the wheel, or: git config core.symlinks true && git checkout -- coartic"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch $@

$(VENV)/.docs: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[docs]'
	@touch $@

clean:
	rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
