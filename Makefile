# Two commands on a fresh machine: `make demo` and `make test`.
PYTHON ?= python3
VENV ?= .venv
BIN = $(VENV)/bin

.PHONY: demo test truth campaign check docs bench page dist clean

$(VENV)/.installed: pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	$(BIN)/python -m compileall -q src tests
	touch $@

$(VENV)/.docs: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[docs]'
	touch $@

demo: $(VENV)/.installed  ## simulate a small survey, extract its lines, score them
	$(BIN)/linework demo demo --overwrite

$(VENV)/.compiled: $(VENV)/.installed $(shell find src/linework/kernels -name '*.py')
	$(BIN)/linework compile --quiet
	touch $@

test: check $(VENV)/.compiled  ## every test, in minutes
	$(BIN)/python -m pytest -n 2 --dist loadscope --no-loadscope-reorder

truth: check $(VENV)/.compiled  ## the long campaigns too: all seeds, all examples
	LINEWORK_TESTS=truth $(BIN)/python -m pytest -n 2 --dist loadscope --no-loadscope-reorder

campaign: $(VENV)/.compiled  ## damaged files, full disks, kills, failing calls: hours; goes on where it was stopped
	$(BIN)/python -m tests.campaign

check: $(VENV)/.installed  ## style, types, import direction
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -n 0 tests/test_architecture.py

docs: $(VENV)/.docs  ## guides and API reference as a website in build/docs; a warning is an error
	$(BIN)/python -m sphinx -b html -W --keep-going -q -j 2 $(SPHINX) docs build/docs

bench: $(VENV)/.installed  ## what is timed (nothing timed is asserted in a test)
	$(BIN)/python -m benchmarks

page:  ## the workbench's page, after a change of its sources (needs Node; users need not)
	cd page && npm ci --no-audit --no-fund && npm run build

dist: $(VENV)/.installed  ## wheel and source distribution in dist/, checked and installed into empty environments
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dist]'
	rm -rf dist
	$(BIN)/python -m build --outdir dist .
	$(BIN)/python -m twine check --strict dist/*
	$(BIN)/python -m tests.install.distribution dist

clean:
	rm -rf $(VENV) demo build dist docs/gallery docs/.examples docs/reference/generated .pytest_cache .mypy_cache .ruff_cache
