# The two commands of the README are `make reproduce` and `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALL := $(PYTHON) -m venv $(VENV) && \
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable
ARGS ?=
FIGURES := also=random_disk
QUICK := seeds=2 num_slots=[10,15,20] training.num_episodes=45 algorithm.guide.warm_up_episodes=30 \
	candidates=2 candidate_episodes=10 evaluation.episodes=200 evaluation.resolution=2

.PHONY: help install setup reproduce figures figures-quick dashboard test test-slow lint format \
	docs dist clean

help: ## list the commands
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 16

install: $(VENV)/.installed ## create .venv with the package and its pinned dependencies

setup: $(VENV)/.developer ## the same with what tests, checks and documentation need

$(VENV)/.installed: pyproject.toml constraints.txt
	$(INSTALL) .
	touch $@

$(VENV)/.dashboard: pyproject.toml constraints.txt
	$(INSTALL) '.[dashboard]'
	touch $(VENV)/.installed $@

$(VENV)/.developer: pyproject.toml constraints.txt
	$(INSTALL) '.[dev]'
	touch $(VENV)/.installed $(VENV)/.dashboard $@

reproduce: install ## train Proposed, Re-OT and Ja-OT, evaluate them, draw the figures
	$(BIN)/python recipes/reproduce.py $(ARGS)

figures: install ## draw all figures of the paper: N = 10 to 20, both layouts, 10 and 5 seeds
	$(BIN)/python recipes/reproduce.py $(FIGURES) seeds=10 further_seeds=5 \
		num_slots=[10,12,14,16,18,20] training.num_episodes=650 $(ARGS)

figures-quick: install ## the same, quick and rough: 2 seeds, N = 10, 15, 20, short trainings
	$(BIN)/python recipes/reproduce.py $(FIGURES) $(QUICK) $(ARGS)

dashboard: $(VENV)/.dashboard ## follow trainings, compare runs, play flights, try scenarios in a browser
	$(BIN)/python recipes/dashboard.py $(ARGS)

test: setup ## run the tests
	$(BIN)/python -m pytest --numprocesses 2 --dist worksteal $(ARGS)

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
	mkdir build/empty/here
	cd build/empty/here && ../bin/hyuav --help && ../bin/hyuav copy train
	cd build/empty/here && ../bin/python -I ../../../examples/first_training.py

clean: ## remove what the other commands made, runs excepted
	rm -rf $(VENV) build dist .mypy_cache .pytest_cache .ruff_cache .hypothesis
