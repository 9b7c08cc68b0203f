# Two commands do everything on a new machine: `make demo`, then `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
ifeq ($(OS),Windows_NT)
BIN := $(VENV)/Scripts
endif
STAMP := $(VENV)/.installed

.PHONY: help demo test test-all quick lint schema bench docs wheel site blender clean

help:  ## Say what each target does.
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 10

$(STAMP): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	@touch $@

demo: $(STAMP)  ## Install into .venv, author and check every preset, drape, render and bake a garment, into demo/; GARMENT=FILE renders yours too.
	$(BIN)/fabricusd demo -o demo
	$(BIN)/python samples/make_samples.py demo
	$(BIN)/fabricusd render demo/skirt.usda -o demo/skirt.exr --width 480 --height 480 --spp 32
	$(BIN)/fabricusd bake demo/skirt.usda --fit --resolution 1024 -o demo/baked --quiet
	$(BIN)/fabricusd material demo/baked --scene demo/skirt.usda -o demo/skirt_look.usda
	@if [ -n "$(GARMENT)" ]; then $(BIN)/fabricusd render "$(GARMENT)" \
		--fabric silk_shot -o demo/garment.exr --width 480 --height 360 --spp 32; fi

test: $(STAMP)  ## Run every test, the linters and the type checker.
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m pytest -n 2 --dist loadfile -m 'not exhaustive'

test-all: test  ## Run also the tests that are slow and rarely fail.
	$(BIN)/python -m pytest -n 2 --dist loadfile -m exhaustive

quick: $(STAMP)  ## Run the tests that take under ten seconds each.
	$(BIN)/python -m pytest -n 2 --dist loadfile -m 'not slow and not exhaustive'

lint: $(STAMP)  ## Format, and mend what the linter can.
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

schema: $(STAMP)  ## Make the plugin folder from schema.usda and the rules.
	$(BIN)/python -m fabricusd.schema.generate

bench: $(STAMP)  ## Run the benchmarks; figures go to stdout.
	for script in bench/bench_*.py bench/*/bench_*.py; do echo "== $$script"; $(BIN)/python $$script || exit 1; done

docs: $(STAMP)  ## Remake every figure and table in docs/.
	for script in docs/make_*.py; do echo "== $$script"; $(BIN)/python $$script || exit 1; done
	$(BIN)/fabricusd chart -o docs/images/charts --page docs/charts.md
	$(BIN)/fabricusd chart -o docs/images/charts --stability docs/stability.md

wheel: $(STAMP)  ## Build the source distribution and a wheel that brings compiled kernels, into dist/.
	rm -rf fabricusd/kernels/ready build/lib
	mkdir -p fabricusd/kernels/ready
	$(BIN)/python -m build --sdist
	$(BIN)/fabricusd cache --pack fabricusd/kernels/ready
	$(BIN)/python -m build --wheel

site: $(STAMP)  ## Build the documentation's site into build/site; open build/site/index.html.
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

# Blender brings its own numpy and needs one version of Python: see `pip index versions bpy`.
BLENDER_PYTHON ?= python3.11
build/bpy/.installed:
	$(BLENDER_PYTHON) -m venv build/bpy
	build/bpy/bin/python -m pip install --quiet bpy==5.0.1 usd-core
	@touch $@

blender: $(STAMP) build/bpy/.installed  ## Compare Cycles with the reference, into build/blender.
	$(BIN)/python bench/materials/blender_compare.py --blender build/bpy/bin/python
	$(BIN)/python bench/materials/blender_compare.py --blender build/bpy/bin/python --light sky

clean:  ## Remove the environment and everything made.
	rm -rf $(VENV) demo build dist *.egg-info
