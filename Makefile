# `make demo` and `make test` set up an environment of their own first: real rclpy and everything else, at the
# versions of constraints.txt. Neither needs a ROS installation, and neither takes anything from one.

PYTHON ?= $(shell for python in python3 python3.12 python3.11; do \
	$$python -c $(SUPPORTED) 2>/dev/null && echo $$python && break; done)
PIP_ARGS ?=
VENV ?= .venv
CONSTRAINTS ?= constraints.txt
OUT ?= out/demo
ROBOT ?= sawyer
PYTEST_ARGS ?=
WORKERS ?= 2

SUPPORTED := 'import sys; sys.exit(sys.version_info[:2] not in ((3, 11), (3, 12)))'
BIN := $(VENV)/bin
PYTEST = $(BIN)/python -m pytest --numprocesses $(WORKERS) --dist loadgroup
STAMP := $(VENV)/.complete
LOWEST := .venv-lowest
LEROBOT := .venv-lerobot
LEROBOT_PYTHON ?= python3.11

# A sourced ROS installation or another environment would mix its libraries with this one's.
unexport PYTHONPATH PYTHONHOME VIRTUAL_ENV
unexport ROS_DISTRO ROS_VERSION ROS_PYTHON_VERSION RMW_IMPLEMENTATION
unexport AMENT_PREFIX_PATH COLCON_PREFIX_PATH CMAKE_PREFIX_PATH
ifneq ($(ROS_DISTRO)$(_ROS_WHEELS_BOOTSTRAP_COMPLETE),)
unexport LD_LIBRARY_PATH _ROS_WHEELS_BOOTSTRAP_COMPLETE
endif

.DEFAULT_GOAL := help
.PHONY: help venv demo rally studio test suite test-fast test-lowest test-lerobot coverage benchmarks campaign soak docs lint format dist clean

help:  ## Say what there is
	@echo "make <target>, with"
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  \1\t\2/p' $(firstword $(MAKEFILE_LIST)) | expand -t 12
	@echo "and the variables"
	@echo "  PYTHON=...    Python 3.11 or 3.12 to make the environment with"
	@echo "  PIP_ARGS=...  more arguments for pip, such as --extra-index-url of CPU-only torch builds"
	@echo "  VENV=...      where the environment lies; $(VENV) now"
	@echo "  ROBOT=...     which arm the demo plays: a name of config/robots or a folder; $(ROBOT) now"
	@echo "  OUT=...       where the demo writes; $(OUT) now"
	@echo "  PYTEST_ARGS=... more arguments for pytest, such as -k simulator"
	@echo "  WORKERS=...   how many tests run side by side; those that start nodes go one by one; $(WORKERS) now"

venv: $(STAMP)  ## Set up the environment

$(STAMP): setup.py $(CONSTRAINTS)
	@test -n "$(PYTHON)" || { echo "make: no Python 3.11 or 3.12 on the PATH: install one, or give PYTHON=/path/to/python3.12" >&2; exit 2; }
	@$(PYTHON) -c $(SUPPORTED) || { echo "make: Python 3.11 or 3.12 is needed, and $(PYTHON) is $$($(PYTHON) --version 2>&1): give PYTHON=/path/to/python3.12" >&2; exit 2; }
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv $(VENV) || { echo "make: $(PYTHON) cannot make environments: install its venv module (Debian, Ubuntu: python3-venv)" >&2; exit 2; }
	@echo '*' > $(VENV)/.gitignore
	@echo "Installing into $(VENV): a few minutes; on Python 3.12 more, where pybullet compiles"
	$(BIN)/python -m pip install --disable-pip-version-check --constraint $(CONSTRAINTS) $(PIP_ARGS) --editable '.[all,test,docs]'
	@touch $@

demo: $(STAMP)  ## Teach, record, replay, train and play all six strokes with ROBOT; report in OUT
	$(BIN)/python -m msrd_ros up demo 'out:=$(OUT)' 'robot:=$(ROBOT)'

rally: $(STAMP)  ## Let two arms ROBOT play each other a hundred rallies; film and report in out/rally
	$(BIN)/python -m msrd_ros rally --robot '$(ROBOT)'

studio: $(STAMP)  ## Start simulator, recorder, executor and the page to watch and drive them with
	$(BIN)/python -m msrd_ros up studio 'robot:=$(ROBOT)'

test: lint suite  ## Check style and types, run all tests

suite: $(STAMP)
	$(PYTEST) $(PYTEST_ARGS)

docs: $(STAMP)  ## Build the site into docs/_build/html; a warning is an error
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html

test-fast: $(STAMP)  ## Run the tests that take seconds: no processes, no studies, no builds
	$(PYTEST) -m "not processes and not slow" --timeout 60 $(PYTEST_ARGS)

test-lowest:  ## Run all tests at the lowest versions that setup.py allows, in an environment of their own
	$(MAKE) VENV=$(LOWEST) CONSTRAINTS=constraints-lowest.txt suite

test-lerobot: $(LEROBOT)/.complete  ## Hold exported data sets against LeRobot, in an environment of its own with 9 GB
	HF_HUB_OFFLINE=1 HF_HOME=$(CURDIR)/$(LEROBOT)/cache $(LEROBOT)/bin/python -m pytest --noconftest $(PYTEST_ARGS) \
		test/recordings/exchange/test_with_lerobot.py

# Without PIP_ARGS: an index of CPU-only torch builds would bring one that torchvision does not load beside.
$(LEROBOT)/.complete: setup.py constraints-lerobot.txt
	$(LEROBOT_PYTHON) -m venv $(LEROBOT)
	@echo '*' > $(LEROBOT)/.gitignore
	$(LEROBOT)/bin/python -m pip install --disable-pip-version-check --constraint constraints-lerobot.txt \
		--editable '.[lerobot,sim]' lerobot pytest pytest-timeout
	@touch $@

coverage: $(STAMP)  ## Run all tests and show which lines of the package they reach
	$(PYTEST) --cov --cov-report term:skip-covered $(PYTEST_ARGS)

benchmarks: $(STAMP)  ## Measure ours beside others' (learning, simulators, bags, start); table in out/benchmarks
	$(BIN)/python benchmarks/compare.py

campaign: $(STAMP)  ## Break the running stack in every way that is known, for about 45 minutes; goes on where it stopped
	$(BIN)/python benchmarks/campaign.py

soak: $(STAMP)  ## Play for eight hours of lockstep time, in about one, and watch memory, handles and threads
	$(BIN)/python benchmarks/soak.py

lint: $(STAMP)  ## Check style and types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

format: $(STAMP)  ## Put the code into shape, and write config/ anew from what the nodes declare
	$(BIN)/ruff format
	$(BIN)/ruff check --fix
	$(BIN)/python -m msrd_ros.nodes.parameter_files

dist: $(STAMP)  ## Build wheel and source distribution into dist/
	rm -rf dist
	$(BIN)/python -m build --no-isolation --outdir dist

clean:  ## Remove the environments, caches and builds; out/ and runs/ stay
	rm -rf build dist install log msrd_ros.egg-info .coverage .coverage.* .pytest_cache .mypy_cache .ruff_cache
	find . -name __pycache__ -not -path './.git/*' -not -path './.venv*' -prune -exec rm -rf {} +
	for made in $(VENV) $(LOWEST) $(LEROBOT); do test ! -e $$made/pyvenv.cfg || rm -rf $$made; done
