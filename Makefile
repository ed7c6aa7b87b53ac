# `make help` lists what can be made. All that is needed is Python >= 3.11 with pip, and make.
PYTHON ?= python3
# Processes that share the tests.
WORKERS ?= auto
# What `make coverage` runs (all tests unless given), and how many of the least covered files it lists.
TESTS ?=
LEAST ?= 30
# How many faults `make mutations` makes, and the seed of their choice.
SAMPLE ?= 300
SEED ?= 19

BIN := .venv/bin
# The base interpreter's pip installs into .venv, which has none of its own: some systems cannot put one there.
PIP := $(PYTHON) -m pip --python $(BIN)/python
INSTALL := $(PIP) install --quiet --no-deps
# Other people's packages on PYTHONPATH (a ROS installation, say) must not stand in for the locked ones.
unexport PYTHONPATH
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: help demo test coverage mutations check bounds javascript kernels bench generated clean lock FORCE
.DEFAULT_GOAL := help

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' Makefile

demo: .venv/core-installed ## install the core, and drive a robot in the browser
	$(BIN)/cinegen demo

test: check javascript kernels ## run every check, then the tests
	@.ci/chromium
	$(BIN)/pytest -n $(WORKERS)

# The table is printed where tests fail too, least covered files first; what fails is still an error.
coverage: .venv/test-installed kernels ## measure which lines the tests run, and list the least covered files
	@.ci/chromium
	@status=0; $(BIN)/pytest -n $(WORKERS) --cov --cov-report= $(TESTS) || status=$$?; \
	$(BIN)/coverage report --sort=cover --skip-covered | awk 'NR <= 2 + $(LEAST) || /^TOTAL/' && exit $$status

mutations: export OMP_NUM_THREADS := 1
mutations: export OPENBLAS_NUM_THREADS := 1
mutations: .venv/test-installed build/cosmic-ray/installed kernels ## put SAMPLE random faults into the core, and list those that no test notices
	@nice $(BIN)/python benchmarks/mutations.py --sample $(SAMPLE) --seed $(SEED)

check: .venv/test-installed ## run the linters of the Python code only
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache # a cached graph does not notice a module that is gone

# Kernels do not check indices; here they do, and IndexError is raised. Numba keeps both kinds under one name: hence a
# cache of its own. `cinegen compile` calls each kernel of assembly modes once.
BOUNDED := tests/loops tests/jit/test_banded.py tests/model/test_couplings.py tests/ik/test_kernel.py tests/ik/test_weights.py tests/robots/test_evaluate.py \
	tests/model/test_close.py tests/model/test_forward.py tests/collision/test_clearance.py \
	tests/planning/test_vortex_kernel.py tests/papers/test_elliptical_potential.py
bounds: export NUMBA_BOUNDSCHECK := 1
bounds: export NUMBA_CACHE_DIR := $(CURDIR)/build/bounds
bounds: .venv/test-installed ## run the tests of the kernels with bounds checking (2 minutes of CPU)
	@$(BIN)/cinegen compile
	$(BIN)/pytest -n $(WORKERS) $(BOUNDED)
	$(BIN)/pytest -n 0 tests/jit/test_bounds.py

javascript: ## lint, type-check and test the page's JavaScript, where node and npm are there
	@.ci/javascript

bench: export OMP_NUM_THREADS := 1
bench: export OPENBLAS_NUM_THREADS := 1
bench: .venv/test-installed kernels ## measure the speed: of a tick, as robots grow, of the cockpit, of assembly modes, ways round obstacles, maps, and beside placo, pink and mink
	$(BIN)/python benchmarks/tick.py
	$(BIN)/python benchmarks/scaling.py
	$(BIN)/python benchmarks/large.py
	$(BIN)/python benchmarks/inverse_kinematics.py
	$(BIN)/python benchmarks/close.py
	$(BIN)/python benchmarks/cockpit.py
	$(BIN)/python benchmarks/modes.py
	$(BIN)/python benchmarks/hexapod.py
	$(BIN)/python benchmarks/assembly.py
	$(BIN)/python benchmarks/avoidance.py
	$(BIN)/python benchmarks/drag.py
	$(BIN)/python benchmarks/maps.py
	@$(MAKE) --no-print-directory .venv-bench/installed || { echo "*** .venv-bench can't be made, for the reason above:" \
		"there is NO comparison with placo, pink and mink. The tables above it stand." >&2; exit 1; }
	$(BIN)/python benchmarks/compare.py

# Nothing else waits for the compiler then, a minute where a kernel has changed.
kernels: .venv/core-installed ## compile all kernels that have changed
	@$(BIN)/cinegen compile

generated: .venv/test-installed ## make the URDF of every robot again
	$(BIN)/raff2urdf robots/*.raff

clean: ## remove the environment and all caches
	rm -rf .venv .venv-bench node_modules build dist .mypy_cache .ruff_cache .pytest_cache .import_linter_cache .hypothesis \
		.coverage .coverage.*
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# --- The environment ---------------------------------------------------------------------------------------------
# Two stamps in .venv say what is installed: the core's lock with the project itself, and on top of it the lock of all
# extras and the tests. A stamp holds the folder it was made for. While pip works .venv/unfinished exists; if it is still
# there at the next start, or Python does not run or has changed, or the folder has moved, then .venv is made again from
# nothing.
VENV_OK := $(shell test ! -e .venv/unfinished \
	&& $(BIN)/python -c 'import os, sysconfig; os.stat(sysconfig.get_path("purelib"))' 2>/dev/null \
	&& { test ! -e .venv/core-installed || grep -qxF '$(CURDIR)' .venv/core-installed; } && echo yes)
ifneq ($(VENV_OK),yes)
.venv/core-installed: FORCE
endif

.venv/core-installed: requirements/core.txt pyproject.toml
	@$(PYTHON) -c "$$CHECK_PYTHON"
	@test "$(VENV_OK)" || rm -rf .venv
	@mkdir -p .venv && touch .venv/unfinished
	@test "$(VENV_OK)" || $(PYTHON) -m venv --without-pip .venv
	@echo "installing into .venv: the locked packages and cinegen itself (the first time takes minutes) ..."
	@$(INSTALL) -r requirements/core.txt
	@$(INSTALL) --no-build-isolation --editable .
	@echo '$(CURDIR)' >$@ && rm .venv/unfinished

.venv/test-installed: requirements/test.txt .venv/core-installed
	@$(PYTHON) -c "$$CHECK_PYTHON"
	@touch .venv/unfinished
	@echo "installing into .venv: what the tests need ..."
	@$(INSTALL) -r requirements/test.txt
	@echo '$(CURDIR)' >$@ && rm .venv/unfinished

# The peers that `make bench` compares us with bring their own Pinocchio: they live apart. bench.txt holds what
# `pip install placo pin-pink mink daqp proxsuite quadprog` gives in an empty environment.
.venv-bench/installed: requirements/bench.txt
	@$(PYTHON) -c "$$CHECK_PYTHON"
	@rm -rf .venv-bench
	@$(PYTHON) -m venv --without-pip .venv-bench
	@echo "installing into .venv-bench: placo, pink, mink and what they need (the first time takes minutes) ..."
	@$(PYTHON) -m pip --python .venv-bench/bin/python install --quiet --no-deps -r requirements/bench.txt
	@touch $@

# It never meets the tests: a folder of its own keeps its versions of other packages from them. mutations.txt holds what
# `pip install cosmic-ray` gives in an empty environment.
build/cosmic-ray/installed: requirements/mutations.txt .venv/core-installed
	@rm -rf build/cosmic-ray
	@$(PIP) install --quiet --no-deps --target build/cosmic-ray -r requirements/mutations.txt
	@touch $@

define CHECK_PYTHON
import sys
say = lambda *words: sys.exit("*** " + " ".join(words) + ". To use another Python: make PYTHON=/path/to/python3 ...")
found = "%s is Python %d.%d" % ((sys.executable,) + sys.version_info[:2])
sys.version_info >= (3, 11) or say("cinegen needs Python 3.11 or newer;", found)
import importlib.util
importlib.util.find_spec("pip") or say(found, "without pip; cinegen is installed with pip")
import pip
tuple(map(int, pip.__version__.split(".")[:2])) >= (22, 3) or say("pip 22.3 or newer is needed, not", pip.__version__)
endef
export CHECK_PYTHON

# --- The locks ---------------------------------------------------------------------------------------------------
# Fresh pins for all that pyproject.toml asks for, and all that asks for in turn: core.txt for what `pip install cinegen`
# installs, test.txt for what all extras and the tests need besides. The build backend is pinned too. embreex is left
# out: yourdfpy, with which the tests read URDFs, only gets faster by it, and it does not exist for every machine. Run
# this with the oldest Python we support, so that every pin exists for it.
lock: ## pin the newest versions of all dependencies in requirements/
	@$(PYTHON) -c "$$CHECK_PYTHON"
	@set -eu; tmp=$$(mktemp -d); trap 'rm -rf "$$tmp"' EXIT; export LC_ALL=C; \
	pins() { \
		venv=$$1; shift; $(PYTHON) -m venv --without-pip "$$tmp/$$venv"; \
		pip="$(PYTHON) -m pip --python $$tmp/$$venv/bin/python"; \
		$$pip install --quiet hatchling "$$@"; \
		$$pip freeze --all --exclude cinegen --exclude embreex >"$$tmp/frozen"; \
		awk -F== '{ n = tolower($$1); gsub(/[-_.]+/, "-", n); print n "==" $$2 }' "$$tmp/frozen" | sort >"$$tmp/$$venv.txt"; \
	}; \
	pins all --editable '.[test]'; \
	pins core --editable . --constraint "$$tmp/all.txt"; \
	comm -23 "$$tmp/all.txt" "$$tmp/core.txt" >requirements/test.txt; \
	cp "$$tmp/core.txt" requirements/core.txt
	@wc -l requirements/*.txt
