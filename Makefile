# The front door. Everything is made inside this folder: .venv, build, results.
#   make run     build, install into .venv, compute and draw the main example
#   make test    the same set-up, then the tests, but for those of seconds a case
#   make check   every test, then builds of other kinds with the tests that each is for: checked while running, sanitized,
#                quadruple, other lanes and instructions, without GSL and OpenMP, with MPI, other BLAS kernels.
#                `make check WAYS="test mpi"`: some, `make check-NAME`: one of them; tools/check.py has their names
#   make fuzz    100,000 mutated scenes and calls; CASES=N for another number
#   make bench   time against error of the solvers; `make bench-forward`: of the integrators; `make accuracy`: of all
#                methods on hard cases. Tables and pictures go to results/benchmarks
#   make bench-peers  MuJoCo, Pinocchio and Exudyn, which pip puts into build/peers, and linkdyn do the same work in one run
#   make renew   put these where benchmarks/README.md and docs/accuracy.md show them
#   make real128 linkdyn-real128, the same program in quadruple precision, beside the installed one
#   make wheel   the wheel and the source archive in build/wheels, the wheel tested where nothing is installed; the first time its
#                libraries are fetched and built. `make wheel WHEEL=--shared`: with the system's, 40 MB
#   make docs    the site with tutorials, gallery and reference, in build/site/html
#   make clean   remove what was made; `make distclean` removes .venv too

PYTHON ?= python3
SHELL := /bin/bash
VENV := $(CURDIR)/.venv
PEERS := build/peers
BUILD := build/wheel
PACKAGE := build/package.stamp
REQUIREMENTS := $(VENV)/requirements.stamp
TEST_REQUIREMENTS := $(VENV)/test_requirements.stamp
DOCS_REQUIREMENTS := $(VENV)/docs_requirements.stamp
EXAMPLE := stewart_drilling

# meson-python finds meson and ninja on the path
export PATH := $(VENV)/bin:$(PATH)
export MPLBACKEND := Agg
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# a BLAS thread team inside every thread of ours would only cost time
export OPENBLAS_NUM_THREADS := 1
unexport PYTHONPATH PYTHONHOME

SOURCES := $(shell find fortran c app python tools viewer -type f \
    -not -name '*.pyc' -not -name '.*' 2>/dev/null) \
    meson.build meson.options pyproject.toml README.md LICENSE
# configuration of the one build folder: for this machine; test and benchmark programs are built only when asked for
SETUP := -Dtests=true -Dbenchmarks=true -Dmarch=native

# the same sources in quadruple precision: the measure of accuracy, not part of the package; its time goes into libquadmath,
# which no optimization of ours makes faster
REAL128 := build/real128

.PHONY: run test check fuzz bench bench-forward bench-peers accuracy renew real128 wheel docs clean distclean system system-mpi browser
.DEFAULT_GOAL := run

run: $(PACKAGE)
	$(VENV)/bin/python examples/$(EXAMPLE)/run.py --out results/$(EXAMPLE)
	@echo "Results and pictures: results/$(EXAMPLE)"

# the hard cases are measured against the quadruple twin; of a test with parameters thirty cases at most, and all by `check`
test: real128 browser $(TEST_REQUIREMENTS)
	@$(VENV)/bin/python tools/run_tests.py $(BUILD) -m "not thorough" --cases 30

check: real128 system-mpi browser $(TEST_REQUIREMENTS)
	@$(VENV)/bin/python tools/check.py $(WAYS)

check-%: real128 $(TEST_REQUIREMENTS)
	@$(VENV)/bin/python tools/check.py $*

check-mpi: system-mpi

fuzz: $(PACKAGE)
	@$(VENV)/bin/python tests/fuzz/fuzz.py --cases $(or $(CASES),100000)

bench: real128
	@$(VENV)/bin/meson compile -C $(BUILD) bench_inverse_real64
	@$(VENV)/bin/meson compile -C $(BUILD) hexapod_by_hand
	$(VENV)/bin/python benchmarks/python/bench_inverse.py
	$(VENV)/bin/python benchmarks/python/bench_hand.py
	$(VENV)/bin/python benchmarks/python/bench_friction.py
	$(VENV)/bin/python benchmarks/python/planar_against_spatial.py

bench-forward: $(PACKAGE)
	@$(VENV)/bin/meson compile -C $(BUILD) bench_forward_real64
	$(VENV)/bin/python benchmarks/python/bench_forward.py

bench-peers: real128 $(PEERS)/requirements.stamp
	$(VENV)/bin/python benchmarks/python/bench_peers.py --python $(PEERS)/bin/python

# one by one: a peer that cannot be installed is left out
$(PEERS)/requirements.stamp: benchmarks/peers/requirements.txt
	@echo "Installing the peers into $(PEERS)"
	@$(PYTHON) -m venv --clear $(PEERS)
	@grep -v '^#' $< | while read -r name; do $(PEERS)/bin/python -m pip install --quiet "$$name" >/dev/null 2>&1 \
	    || echo "left out: $$name, pip cannot install it"; done
	@touch $@

renew: $(REQUIREMENTS)
	$(VENV)/bin/python benchmarks/python/renew.py

real128: $(PACKAGE)
	@[ -f $(REAL128)/build.ninja ] || $(VENV)/bin/meson setup $(REAL128) -Dreal128=enabled -Doptimization=1
	@$(VENV)/bin/meson compile -C $(REAL128) linkdyn-real128
	@cp $(REAL128)/app/linkdyn-real128 "$$($(VENV)/bin/python -c 'from linkdyn import cli; print(cli.executable().parent)')"

accuracy: real128
	$(VENV)/bin/python benchmarks/python/accuracy.py

wheel: $(REQUIREMENTS)
	$(VENV)/bin/python tools/list_requirements.py wheel > $(VENV)/wheel.txt
	$(VENV)/bin/python -m pip install --quiet -r $(VENV)/wheel.txt
	$(VENV)/bin/python tools/make_wheel.py $(WHEEL)

# tutorials use what tests use, too
docs: $(PACKAGE) $(DOCS_REQUIREMENTS) $(TEST_REQUIREMENTS)
	@$(VENV)/bin/python tools/build_docs.py build/site

$(DOCS_REQUIREMENTS): docs/site/requirements.txt $(REQUIREMENTS)
	@echo "Installing what the site needs into .venv"
	$(VENV)/bin/python -m pip install --quiet -r docs/site/requirements.txt
	@touch $@

# looks every time, which is quick, and installs only what is missing
system:
	@sh tools/install_packages.sh $(PYTHON)

# without it tools/check.py says what it leaves out
system-mpi:
	@MPI=1 sh tools/install_packages.sh $(PYTHON) || echo "No MPI: what needs it is left out"

# the viewer is tested in a browser without a window
browser: | system
	@TESTS=1 sh tools/install_packages.sh $(PYTHON)

# what a build and the package need, from pyproject.toml;
# an older pip forgets all but the last of several settings for the build
$(REQUIREMENTS): pyproject.toml tools/list_requirements.py | system
	@$(VENV)/bin/pip --version >/dev/null 2>&1 || { rm -rf $(VENV); $(PYTHON) -m venv $(VENV); }
	@echo "Installing the Python packages into .venv"
	$(VENV)/bin/python tools/list_requirements.py build run > $(VENV)/requirements.txt
	$(VENV)/bin/python -m pip install --quiet "pip>=23.1" -r $(VENV)/requirements.txt
	@touch $@

# as much again, which only tests and the site want
$(TEST_REQUIREMENTS): $(REQUIREMENTS)
	@echo "Installing what tests need into .venv"
	$(VENV)/bin/python tools/list_requirements.py test > $(VENV)/test_requirements.txt
	$(VENV)/bin/python -m pip install --quiet -r $(VENV)/test_requirements.txt
	@touch $@

# the folder is kept, so that only what changed is compiled again
$(PACKAGE): $(SOURCES) $(REQUIREMENTS) | system
	@echo "Building linkdyn and installing it into .venv"
	$(VENV)/bin/python -m pip install --quiet --no-build-isolation --no-deps --force-reinstall \
	    --config-settings=build-dir=$(BUILD) $(foreach option,$(SETUP),--config-settings=setup-args=$(option)) .
	@$(VENV)/bin/python -c "from linkdyn._view.page import bundle; bundle()" 2>/dev/null || printf '%s\n' \
	    "WARNING: built without the viewer, \`linkdyn view\` will not work. This was missing:" \
	    "$$(grep -h 'WITHOUT its viewer' $(BUILD)/meson-logs/meson-log.txt | tail -n 1)" >&2
	@touch $@

clean:
	rm -rf build results

distclean: clean
	rm -rf .venv
