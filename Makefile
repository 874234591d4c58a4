# Development tasks; `make` alone lists them. Needs Python 3.11 or newer with its venv module.

VENV := .venv
BIN := $(VENV)/bin
DEMO := demo
# Folder for the environments of benchmark peers, name of this machine, folder for its results.
BENCH := .venv-bench
NAME ?= here
RESULTS = $(if $(QUICK),build/benchmarks,benchmarks/results/$(NAME))

# The first interpreter that works (a name on the path may be a broken shim), is new enough and can
# create virtual environments. Evaluated only when $(VENV) has to be created.
PYTHON ?= $(shell for python in python3.13 python3.12 python3.11 python3; do \
	"$$python" -c 'import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 11))' \
		>/dev/null 2>&1 && { echo "$$python"; break; }; \
	done)

# Each worker runs whole files, since the tests of a file share compiled programs.
PYTEST = $(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder

# pip shows progress bars on a terminal, and is quiet in a log.
PIP = $(BIN)/python -m pip install --disable-pip-version-check $$([ -t 1 ] || echo --quiet)

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL:
.PHONY: help setup test test-slow test-all trainings coverage check docs demo bench compare partners \
	lanes fuzz endurance clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-9s %s\n", $$1, $$2 }' Makefile
	@echo "  PYTHON=/path/to/python chooses the interpreter for a new $(VENV), ARGS=... adds arguments"

setup: $(VENV)/.dev ## create .venv with everything for tests and checks

test: $(VENV)/.dev ## run the tests for every change, in a few minutes
	$(PYTEST) --quick $(ARGS)

test-slow: $(VENV)/.dev ## run the slow tests that make test leaves out
	$(PYTEST) -m "(slow or optimised) and not (variant or training)" $(ARGS)

test-all: $(VENV)/.dev ## run all tests on every environment, except those that train agents
	$(PYTEST) --quick -m "variant or not (slow or training)" $(ARGS)
	$(MAKE) test-slow

trainings: $(VENV)/.dev ## run the tests that train agents
	$(PYTEST) -m training $(ARGS)

coverage: $(VENV)/.dev ## show lines and branches that no test reaches; LINES=1: only lines, faster
	$(if $(LINES),COVERAGE_CORE=sysmon) $(PYTEST) --quick --cov --cov-report=term-missing \
		$(if $(LINES),,--cov-branch) $(ARGS)

check: $(VENV)/.dev ## check style, formatting and types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/pyright

docs: $(VENV)/.docs ## build the documentation in docs/_build/html
	$(BIN)/python -m sphinx -W --keep-going -q -d docs/_build/cache docs docs/_build/html $(ARGS)

demo: $(VENV)/.baselines ## train an agent in about 3 minutes; its curve and a GIF go to demo/
	@rm -rf $(DEMO)/run && mkdir -p $(DEMO)
	$(BIN)/jaxenstein train --config demo --out $(DEMO)/run
	$(BIN)/jaxenstein plot $(DEMO)/run --metric success --out $(DEMO)/learning_curve.png
	$(BIN)/jaxenstein evaluate $(DEMO)/run --gif $(DEMO)/agent.gif

bench: ## run all benchmarks; pages go to build/benchmarks/pages (75 minutes; QUICK=1: a few minutes)
	@$(MAKE) --no-print-directory VENV=$(BENCH)/main $(BENCH)/main/.bench
	$(BENCH)/main/bin/python -m benchmarks.install
	$(BENCH)/main/bin/python -m benchmarks --json $(RESULTS) $(if $(QUICK),--quick) $(ARGS)
	$(BENCH)/main/bin/python -m benchmarks.report $(RESULTS)

compare: $(VENV)/.bench ## compare the speed with ViZDoom, on one core
	$(BIN)/python -m benchmarks peers --only vizdoom-gymnasium vizdoom-raw loop scan $(ARGS)

partners: $(VENV)/.dev ## test adapters and examples with their packages; ARGS="-k gymnax" runs some
	$(BIN)/python -m nox -t partners $(ARGS)

lanes: $(VENV)/.dev ## test every Python, the oldest and newest JAX, and the wheel; ARGS="-p 3.12" runs some
	$(BIN)/python -m nox -t lanes $(ARGS)

fuzz: $(VENV)/.dev ## fuzz maps and files; ARGS="--minutes 60 --target ascii"
	$(BIN)/python -m reliability.fuzz $(ARGS)

endurance: $(VENV)/.dev ## check every state of millions of steps; ARGS="--steps 10_000_000"
	$(BIN)/python -m reliability.endurance $(ARGS)

clean: ## remove .venv and all generated files
	rm -rf $(VENV) .nox $(BENCH) $(DEMO) fuzz docs/_build docs/environments docs/commands.md build dist \
		benchmarks/results/here _vizdoom _vizdoom.ini \
		.coverage .pytest_cache .ruff_cache .hypothesis
	find src tests benchmarks docs examples experiments fidelity reliability \
		-name __pycache__ -type d -prune -exec rm -rf {} +

# A stamp is written only after its step has succeeded, so an interrupted step runs again.
# An existing environment with a working pip is kept.
$(VENV)/.created:
	@[ -n "$(PYTHON)" ] || \
		{ echo "found no Python 3.11 or newer with venv; set PYTHON=..." >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "$(PYTHON) is not a working Python 3.11 or newer" >&2; exit 1; }
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || \
		{ echo "Creating $(VENV) with $(PYTHON) ..." && $(PYTHON) -m venv --clear $(VENV); }
	@touch $@

$(VENV)/.core: pyproject.toml src/jaxenstein/version.py $(VENV)/.created
	@echo "Installing jaxenstein with jax, numpy and pillow (about 150 MB) ..."
	@$(PIP) --editable .
	@touch $@

$(VENV)/.dev: $(VENV)/.core
	@echo "Installing tools for tests and checks ..."
	@$(PIP) --editable '.[dev]'
	@touch $@

$(VENV)/.docs: $(VENV)/.core
	@echo "Installing Sphinx, furo, MyST, flax and optax for the documentation ..."
	@$(PIP) --editable '.[docs]'
	@touch $@

$(VENV)/.baselines: $(VENV)/.core
	@echo "Installing flax, optax and matplotlib for the baselines ..."
	@$(PIP) --editable '.[baselines]'
	@touch $@

$(VENV)/.bench: $(VENV)/.core
	@echo "Installing ViZDoom, Gymnasium, OpenCV, flax and optax ..."
	@$(PIP) --editable '.[bench,baselines]'
	@touch $@
