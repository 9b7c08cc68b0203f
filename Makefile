# Two commands do everything on a new machine: `make demo`, then `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
ifeq ($(OS),Windows_NT)
BIN := $(VENV)/Scripts
endif
STAMP := $(VENV)/.installed

.PHONY: help demo test quick lint schema bench docs clean

help:  ## Say what each target does.
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 10

$(STAMP): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	@touch $@

demo: $(STAMP)  ## Install into .venv, then author, check and print every preset into demo/.
	$(BIN)/fabricusd demo -o demo

test: $(STAMP)  ## Run every test, the linters and the type checker.
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m pytest

quick: $(STAMP)  ## Run the tests that take under ten seconds each.
	$(BIN)/python -m pytest -m 'not slow'

lint: $(STAMP)  ## Format, and mend what the linter can.
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

schema: $(STAMP)  ## Make the plugin folder from schema.usda and the rules.
	$(BIN)/python -m fabricusd.schema.generate

bench: $(STAMP)  ## Run the benchmarks; figures go to stdout.
	for script in bench/bench_*.py; do echo "== $$script"; $(BIN)/python $$script || exit 1; done

docs: $(STAMP)  ## Remake every figure and table in docs/.
	for script in docs/make_*.py; do echo "== $$script"; $(BIN)/python $$script || exit 1; done

clean:  ## Remove the environment and everything made.
	rm -rf $(VENV) demo build dist *.egg-info
