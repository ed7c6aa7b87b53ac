# `make help` lists what can be made. All that is needed is Python >= 3.11 with pip, and make.
PYTHON ?= python3
# Processes that share the tests: one for each core. One more took as long on two cores.
WORKERS ?= $(shell getconf _NPROCESSORS_ONLN)
# What `make coverage` runs (all tests unless given), and how many of the least covered files it lists.
TESTS ?=
LEAST ?= 30
# How many faults `make mutations` makes, and the seed of their choice.
SAMPLE ?= 300
SEED ?= 19
# How long `make campaign` takes.
HOURS ?= 1
# How many random values `make nightly` gives to the generated code and the page of each robot.
VALUES ?= 100000

BIN := .venv/bin
# The base interpreter's pip installs into .venv, which has none of its own: some systems cannot put one there.
PIP := $(PYTHON) -m pip --python $(BIN)/python
# A locked package is installed only if its file has one of the hashes in the lock; nothing else comes along. Python
# compiles a module when it is first imported: most never are.
LOCKED := install --quiet --no-deps --require-hashes --no-compile
INSTALL := $(PIP) $(LOCKED)
# Other people's packages on PYTHONPATH (a ROS installation, say) must not stand in for the locked ones.
unexport PYTHONPATH
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: help demo test ready nightly coverage mutations campaign check bounds docs pdf javascript kernels bench generated sbom audit clean lock FORCE
.DEFAULT_GOAL := help

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' Makefile

demo: .venv/core-installed ## install the core, and drive a robot in the browser
	$(BIN)/cinegen demo

# `+`: what it prints is shown as it comes, also where other targets are made beside it.
test: ready ## run every check, then the tests but for those of `make nightly`
	+$(BIN)/pytest -n $(WORKERS)

# Kernels need the core only: they are compiled while the rest is installed.
ready: ## run every check, and compile all kernels: what the tests need
	@$(MAKE) --no-print-directory -j2 --output-sync check javascript kernels
	@.ci/chromium

# What takes hours and finds the rare: tests that repeat what others prove with other numbers or robots, hostile input,
# and random values of generated code and of pages.
nightly: ready docs ## run what continuous integration leaves out, one hour of `make campaign` (HOURS) included
	$(BIN)/pytest -n $(WORKERS) -m slow
	@$(MAKE) --no-print-directory campaign
	$(BIN)/python benchmarks/generated.py $(VALUES)
	$(BIN)/python benchmarks/page.py $(VALUES)

# The table is printed where tests fail too, least covered files first; what fails is still an error.
coverage: .venv/test-installed kernels ## measure which lines the tests run, and list the least covered files
	@.ci/chromium
	@status=0; $(BIN)/pytest -n $(WORKERS) --cov --cov-report= $(TESTS) || status=$$?; \
	$(BIN)/coverage report --sort=cover --skip-covered | awk 'NR <= 2 + $(LEAST) || /^TOTAL/' && exit $$status

mutations: export OMP_NUM_THREADS := 1
mutations: export OPENBLAS_NUM_THREADS := 1
mutations: .venv/test-installed kernels ## put SAMPLE random faults into the core, and list those that no test notices
	@nice $(BIN)/python benchmarks/mutations.py --sample $(SAMPLE) --seed $(SEED)

# The campaign is a package of the tests.
campaign: .venv/test-installed kernels ## attack readers, solver, page and commands for HOURS on all cores; build/campaign/report.md
	@PYTHONPATH=tests $(BIN)/python -m campaign all --hours $(HOURS)

check: .venv/test-installed ## run the linters of the Python code and of the prose only
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache # a cached graph does not notice a module that is gone
	$(BIN)/python tests/docs/prose.py
	$(BIN)/codespell *.md docs cinegen raff2urdf robots examples benchmarks ros2 # tests misspell names on purpose

# Kernels do not check indices; here they do, and IndexError is raised. Numba keeps both kinds under one name: hence a
# cache of its own. `cinegen compile` calls each kernel of assembly modes once.
BOUNDED := tests/loops tests/jit/test_banded.py tests/model/test_couplings.py tests/ik/test_kernel.py tests/ik/test_levels.py tests/ik/test_weights.py tests/robots/test_evaluate.py \
	tests/model/test_close.py tests/model/test_forward.py tests/assembly/test_modes_any.py tests/assembly/test_modes_coupled.py tests/collision/test_clearance.py \
	tests/planning/test_vortex_kernel.py tests/papers/test_enclosing_potentials.py tests/dynamics/test_inverse_dynamics.py \
	tests/design/test_design_parameters.py
bounds: export NUMBA_BOUNDSCHECK := 1
bounds: export NUMBA_CACHE_DIR := $(CURDIR)/build/bounds
bounds: .venv/test-installed ## run the tests of the kernels with bounds checking (5 minutes of CPU)
	@nice $(BIN)/cinegen compile
	nice $(BIN)/pytest -n $(WORKERS) $(BOUNDED)
	$(BIN)/pytest -n 0 tests/jit/test_bounds.py

# Sphinx comes with packages of its own: they live apart, but see those that the pages document.
docs: .venv/test-installed build/sphinx/installed ## build the site, build/site/html/index.html; what leads nowhere is an error
	@PYTHONPATH=build/sphinx nice $(BIN)/python docs/site/build.py

pdf: docs ## print the site's pages as one PDF, build/site/cinegen.pdf
	@PYTHONPATH=build/sphinx $(BIN)/python docs/site/pdf.py

javascript: ## lint, type-check and test the page's JavaScript, where node and npm are there
	@.ci/javascript

bench: export OMP_NUM_THREADS := 1
bench: export OPENBLAS_NUM_THREADS := 1
bench: .venv/test-installed kernels ## measure the speed, and write the tables of docs/measurements.md: of a tick, as robots grow, and beside placo, pink and mink; print that of closing loops, forces, the cockpit, assembly modes, ways round obstacles and maps
	@for name in close forces cockpit hexapod avoidance maps; do \
		$(BIN)/python benchmarks/$$name.py || exit 1; done
	@$(MAKE) --no-print-directory .venv-bench/installed || echo "*** .venv-bench can't be made, for the reason above:" \
		"there is NO comparison with placo, pink and mink." >&2
	$(BIN)/python benchmarks/measurements.py

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
	@$(PIP) install --quiet --no-deps --no-build-isolation --editable .
	@echo '$(CURDIR)' >$@ && rm .venv/unfinished

.venv/test-installed: requirements/test.txt .venv/core-installed
	@$(PYTHON) -c "$$CHECK_PYTHON"
	@touch .venv/unfinished
	@echo "installing into .venv: what the tests need ..."
	@$(INSTALL) -r requirements/test.txt
	@echo '$(CURDIR)' >$@ && rm .venv/unfinished

# The peers that `make bench` compares us with bring their own Pinocchio: they live apart.
.venv-bench/installed: requirements/bench.txt
	@$(PYTHON) -c "$$CHECK_PYTHON"
	@rm -rf .venv-bench
	@$(PYTHON) -m venv --without-pip .venv-bench
	@echo "installing into .venv-bench: placo, pink, mink and what they need (the first time takes minutes) ..."
	@$(PYTHON) -m pip --python .venv-bench/bin/python $(LOCKED) -r requirements/bench.txt
	@touch $@

# A folder of its own keeps its versions of other packages from the tests.
build/sphinx/installed: requirements/docs.txt .venv/core-installed
	@rm -rf build/sphinx
	@$(INSTALL) --target build/sphinx -r requirements/docs.txt
	@touch $@

# What looks at the locks and makes them: uv, pip-audit, cyclonedx-py.
build/tools/installed: requirements/tools.txt
	@$(PYTHON) -c "$$CHECK_PYTHON"
	@rm -rf build/tools
	@$(PYTHON) -m venv --without-pip build/tools
	@$(PYTHON) -m pip --python build/tools/bin/python $(LOCKED) -r requirements/tools.txt
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
# Pins with hashes for all that pyproject.toml asks for, and all that asks for in turn: core.txt for what `pip install
# cinegen` installs, and the build backend; test.txt for what all extras and the tests need besides. embreex is left out:
# trimesh only gets faster by it, and it does not exist for every machine. The locks are for the oldest Python we support,
# so that every pin exists for it. What is pinned stays pinned unless UPGRADE=1.
lock: build/tools/installed ## pin what pyproject.toml asks for in requirements/, and with UPGRADE=1 the newest versions of it
	@set -eu; tmp=$$(mktemp -d); trap 'rm -rf "$$tmp"' EXIT; \
	pins() { \
		lock=$$1; shift; touch "$$tmp/$$lock.txt"; \
		build/tools/bin/uv pip compile --quiet --no-config --python-version 3.11 --generate-hashes --no-header --no-annotate \
			--no-emit-package cinegen --no-emit-package embreex $(if $(UPGRADE),--upgrade) -o "$$tmp/$$lock.txt" "$$@"; \
	}; \
	cp requirements/*.txt "$$tmp"; cat requirements/core.txt requirements/test.txt >"$$tmp/all.txt"; \
	echo hatchling | pins all pyproject.toml --extra test -; \
	echo hatchling | pins core pyproject.toml - --constraint "$$tmp/all.txt"; \
	awk '/^[a-z]/ { keep = !($$1 in core); if (NR == FNR) core[$$1] } NR > FNR && keep' \
		"$$tmp/core.txt" "$$tmp/all.txt" >"$$tmp/test.txt"; \
	printf '%s\n' placo pin-pink mink daqp proxsuite quadprog | pins bench -; \
	printf '%s\n' sphinx furo myst-parser latex2mathml | pins docs -; \
	printf '%s\n' uv pip-audit cyclonedx-bom | pins tools -; \
	for lock in core test bench docs tools; do cp "$$tmp/$$lock.txt" requirements; done
	@grep -c == requirements/*.txt

sbom: .venv/test-installed build/tools/installed ## list all packages in .venv in build/sbom.json (CycloneDX)
	@build/tools/bin/python .ci/sbom $(BIN)/python build/sbom.json

# pip-audit passes over packages that its database does not know, or does not answer for, unless it is strict.
audit: build/tools/installed ## look for known vulnerabilities of locked packages; needs the advisory database of pypi.org
	@status=0; build/tools/bin/pip-audit --strict --disable-pip --require-hashes --progress-spinner off \
		$(patsubst %,-r requirements/%.txt,core test bench docs tools) >build/audit.txt 2>build/audit.log || status=$$?; \
	if grep -E '^(No|Found [0-9]+) known vulnerabilit' build/audit.log; then cat build/audit.txt; exit $$status; fi; \
	tail -n 1 build/audit.log >&2; \
	echo "*** NOT AUDITED: the advisory database does not answer for every package (build/audit.log)." >&2; exit 1
