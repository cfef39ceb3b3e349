# The two commands of the README are `make reproduce` and `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
ARGS ?=
FIGURES := also=random_disk
QUICK := seeds=2 num_slots=[10,15,20] training.num_episodes=45 algorithm.guide.warm_up_episodes=30 \
	candidates=2 candidate_episodes=10 evaluation.episodes=200 evaluation.resolution=2

.PHONY: help setup reproduce figures figures-quick dashboard test test-slow lint format docs dist \
	clean

help: ## list the commands
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 16

setup: $(VENV)/.ready ## create .venv with the pinned dependencies

$(VENV)/.ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	touch $@

reproduce: setup ## train Proposed, Re-OT and Ja-OT, evaluate them, draw the figures
	$(BIN)/python recipes/reproduce.py $(ARGS)

figures: setup ## draw all figures of the paper: N = 10 to 20, both layouts, 10 and 5 seeds
	$(BIN)/python recipes/reproduce.py $(FIGURES) seeds=10 further_seeds=5 \
		num_slots=[10,12,14,16,18,20] training.num_episodes=650 $(ARGS)

figures-quick: setup ## the same, quick and rough: 2 seeds, N = 10, 15, 20, short trainings
	$(BIN)/python recipes/reproduce.py $(FIGURES) $(QUICK) $(ARGS)

dashboard: setup ## follow trainings, compare runs, play flights, try scenarios in a browser
	$(BIN)/python recipes/dashboard.py $(ARGS)

test: setup ## run the tests
	$(BIN)/python -m pytest --numprocesses 2 $(ARGS)

test-slow: setup ## run the checks that take minutes: learning, pages, distributions
	$(BIN)/python -m pytest -m slow $(ARGS)

lint: setup ## check style, formatting, types, docstrings, dependencies and imports
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/interrogate src
	$(BIN)/deptry .
	$(BIN)/lint-imports
	$(BIN)/mypy

format: setup ## format the code
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: setup ## build the documentation into build/site, strictly and without a network
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict --site-dir build/site

dist: setup ## build wheel and sdist, and try the wheel in an empty environment
	rm -rf dist build/empty
	$(BIN)/python -m build --no-isolation
	$(PYTHON) -m venv build/empty
	build/empty/bin/python -m pip install --quiet --constraint constraints.txt dist/*.whl
	cd build && empty/bin/python -I ../examples/first_training.py

clean: ## remove what the other commands made, runs excepted
	rm -rf $(VENV) build dist .mypy_cache .pytest_cache .ruff_cache .hypothesis
