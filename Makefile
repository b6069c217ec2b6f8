# The commands of a user and of CI. They install into .venv and build/; nothing has to be exported or sourced.

BIN := .venv/bin

# A sourced ROS 2 install finds our messages as an overlay. The ROS 2 wheels look into .venv by themselves.
ifdef AMENT_PREFIX_PATH
export AMENT_PREFIX_PATH := $(CURDIR)/.venv:$(AMENT_PREFIX_PATH)
export LD_LIBRARY_PATH := $(CURDIR)/.venv/lib$(if $(LD_LIBRARY_PATH),:$(LD_LIBRARY_PATH))
else
unexport PYTHONPATH
endif
unexport PYTHONHOME _ROS_WHEELS_BOOTSTRAP_COMPLETE

# Without bytecode beside the sources every process would compile what it imports: half a second for a node.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help setup setup-demo interfaces demo test test-core test-ros test-fast coverage lint format docs fuzz fuzz-files fuzz-inputs soak bench bench-peers \
	release-tree clean
.DEFAULT_GOAL := help

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## /\1	/p' Makefile | while IFS='	' read -r target text; do printf '  make %-12s %s\n' "$$target" "$$text"; done

setup: ## set up what is missing: environment, ROS 2, messages, package, compiled kernels
	@sh scripts/set_up/start.sh

setup-demo: ## set up what the demo needs; the rest compiles in the background afterwards
	@sh scripts/set_up/start.sh demo

demo: setup-demo ## play a scene and show the monitor's answers, live in this terminal
	@$(BIN)/collision-monitor demo

interfaces: setup ## build the message packages that the wheels lack: tf2, vision, autoware, moveit, maps
	@$(BIN)/python scripts/set_up/interfaces.py

test: interfaces ## set up, lint and run every test
	@$(MAKE) --no-print-directory -j2 lint test-core
	@$(MAKE) --no-print-directory test-ros

test-core: setup ## run the tests, except those of the node and of the set-up
	@$(BIN)/python -m pytest -n auto --dist worksteal --ignore=test/ros --ignore=test/setup

test-ros: interfaces ## run the tests of the node and of the set-up
	@env -u MAKEFLAGS $(BIN)/python -m pytest -n 3 --dist worksteal test/ros test/setup  # they call make themselves

# What a change most likely breaks, in less than a minute: the order of the source, and what every answer goes through.
FAST := test/test_house.py test/test_layers.py test/test_public_api.py test/test_lazy_names.py test/checks test/settings \
	test/shapes/test_kinds.py test/codec test/motion test/golden \
	$(addprefix test/monitor/test_, monitor.py tracking.py stages.py scene_plan.py switching.py against_queries.py result.py) \
	$(addprefix test/monitor/contacts/test_, plain_contacts.py carried_contacts.py)

test-fast: setup ## run the tests of what a change most likely breaks, less than a minute
	@$(BIN)/python -m pytest -q -n auto --dist worksteal $(FAST)

coverage: setup ## run test-core, and write which lines of Python it runs into build/coverage; compiled kernels do not count
	@$(BIN)/python -m pytest -n auto --dist worksteal --ignore=test/ros --ignore=test/setup \
		--cov --cov-report=term --cov-report=html:build/coverage

lint: setup ## run ruff, mypy --strict and codespell
	@$(BIN)/ruff check .
	@$(BIN)/mypy
	@$(BIN)/codespell

CHANGED = { git diff --name-only --diff-filter=d HEAD; git ls-files --others --exclude-standard; } | grep '\.py$$'

format: setup ## let ruff mend and format the Python files that git has as changed or new
	@$(CHANGED) | xargs -r $(BIN)/ruff check --fix --force-exclude
	@$(CHANGED) | xargs -r $(BIN)/ruff format --force-exclude

docs: setup ## build the reference of the Python API into build/docs, and check every link
	@$(BIN)/python -m sphinx -W --keep-going -q -b html docs/reference build/docs
	@$(BIN)/python scripts/links.py build/docs
	@$(BIN)/python scripts/links.py

fuzz: setup ## attack the monitor with hostile messages; ARGS="--messages 1000000 --seed 7", --dds for a node
	@$(BIN)/python test/attacks/fuzz_messages.py $(ARGS)

fuzz-files: setup ## read damaged and hostile copies of sessions; ARGS="--files 100000"
	@$(BIN)/python test/attacks/fuzz_sessions.py $(ARGS)

fuzz-inputs: setup ## read damaged bags, meshes, robot descriptions and YAML; ARGS="--files 100000"
	@$(BIN)/python test/attacks/fuzz_inputs.py $(ARGS)

soak: setup ## simulate 24 h of objects that come, change and go, and compare with plain recomputation; ARGS="--hours 1"
	@$(BIN)/python benchmarks/soak.py $(ARGS)

QUICK := $(findstring --quick,$(ARGS))

bench: setup ## time single calls, a start, full detection and every installed peer, the event list, the node; ARGS=--quick takes 3 minutes
	@$(BIN)/python benchmarks/run.py $(ARGS)
	@$(BIN)/python benchmarks/mesh_pairs.py $(QUICK)
	@$(BIN)/python benchmarks/single_calls.py $(QUICK)
	@$(BIN)/python benchmarks/first_start.py
	@$(BIN)/python benchmarks/event_list.py $(if $(QUICK),--seconds 1)
	@$(BIN)/python benchmarks/through_node.py $(if $(QUICK),--duration 10)
	@$(BIN)/python benchmarks/memory.py $(QUICK)

bench-peers: ## install the systems that bench compares with
	@sh benchmarks/install_peers.sh

release-tree: setup-demo ## lay both ROS packages side by side in build/release, as bloom and colcon want them
	@$(BIN)/python scripts/release_tree.py $(ARGS)

clean: ## remove all files that the set-up or a build made
	rm -rf .venv .venv-peers build install log .coverage .mypy_cache .ruff_cache .pytest_cache .hypothesis *.egg-info
