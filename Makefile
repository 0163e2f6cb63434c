# The only door. `make` prints the commands; each of them installs what it lacks and skips what is up to date.
.DEFAULT_GOAL := help
SHELL := /bin/bash
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.up-to-date
# CI runs Python 3.11; another interpreter may have to compile pybullet.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
# How long the demo plays; 0: until Ctrl-C.
SECONDS ?= 120

.PHONY: help setup demo test lint integration bench paper clean

help: ## print this list
	@grep -hE '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## (.*)/  make \1\t\2/' | expand -t 20

setup: $(STAMP) ## install system packages (apt) and Python packages (.venv); nothing to do when up to date

$(STAMP): pyproject.toml constraints.txt deploy/system-packages.txt deploy/system-packages.sh
	@deploy/system-packages.sh
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch $@

demo: $(STAMP) ## two minutes of the whole loop: a UR3 at work while a hand and boxes come in its way (SECONDS=0: no end)
	$(BIN)/tolman demo --seconds $(SECONDS)

test: $(STAMP) ## every test: unit, property, golden, architecture, whole commands; then integration
	$(BIN)/python -m pytest -m "not integration" -n 2 --dist loadfile
	$(BIN)/python -m pytest -m integration

integration: $(STAMP) ## only the tests that start real processes
	$(BIN)/python -m pytest -m integration

lint: $(STAMP) ## ruff, mypy --strict, import law
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(STAMP) ## the figures of README, one JSON each, into report/ (hours; PROBLEMS=FILE: MotionBenchMaker's problems too)
	mkdir -p report
	$(BIN)/tolman build --force --json report/build.json
	for set in task off_task; do $(BIN)/tolman bench replan --set $$set --n 500 --json report/replan-$$set.json || exit 1; done
	$(BIN)/tolman bench replan --set wall --n 100 --json report/replan-wall.json
	$(BIN)/tolman bench learned --set task --n 500 --json report/learned.json
	$(BIN)/tolman bench payload --box 0.05 0.05 0.08 --json report/payload.json
	for seed in 0 1 2 3 4; do $(BIN)/tolman demo --headless --seconds 120 --seed $$seed --json report/demo-$$seed.json || exit 1; done
	$(BIN)/tolman bench peers --set task --n 500 --json report/peers.json
	$(BIN)/tolman bench sizes --json report/sizes.json --plot report/sizes.png
	test -z "$(PROBLEMS)" || $(BIN)/tolman bench solve --robot ur5 --problems "$(PROBLEMS)" --folds 7 --json report/solve.json

paper: $(STAMP) ## the paper's experiments beside ours, as a report in report/ (45 minutes; trains the maps first)
	$(BIN)/tolman paper --out report

clean: ## remove what setup made
	rm -rf $(VENV) report
