# `make demo` and `make test` do all set-up themselves; only python3 (3.11 or newer) and a network are needed.
# Set-up leaves stamps in .venv/, so that a second call starts at once.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
JOBS ?= 2
SETUP ?= yes
PYTEST_ARGS ?=
# Environments of other projects' programs, and which of them `make test-interop` runs.
INTEROP ?= .interop
INTEROP_ENVS ?= $(notdir $(patsubst %/requirements.txt,%,$(wildcard tests/interop/*/requirements.txt)))

.DEFAULT_GOAL := help
.PHONY: help setup web demo test test-slow test-gpu test-interop check docs homes-check pools demonstrations gallery format bench clean distclean

help:
	@echo "make demo       convert the small home, run it, cook a fish in it; leaves pictures, a plot, films, a report"
	@echo "make test       the quick tests (JOBS=$(JOBS) processes)"
	@echo "make test-slow  the tests that take long"
	@echo "make test-gpu   the tests that need a CUDA device, in parts that go on (SETUP=no PYTHON=python3: installs nothing)"
	@echo "make test-interop  with other projects' programs, each in an environment of its own (some GB; INTEROP_ENVS=...)"
	@echo "make check      ruff and pyright"
	@echo "make web        fetch three.js for the page of \`ig2mj vr\` (needs npm)"
	@echo "make docs       the documentation site, in out/site/"
	@echo "make homes-check  build and convert all homes again and compare them with scenes_mjcf/"
	@echo "make pools      sample the start states that ship again (some minutes on many processors)"
	@echo "make demonstrations  record the demonstrations that ship again"
	@echo "make gallery     render the images of docs/guide/gallery.md"
	@echo "make format     let ruff put the code in order"
	@echo "make bench      the benchmarks of the native engine; results in benchmarks/results/"
	@echo "make setup      only the set-up: .venv and OpenGL libraries"
	@echo "make clean      remove what runs and builds left; make distclean removes .venv too"

setup: $(VENV)/.installed $(VENV)/.gl

$(VENV)/.created:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "error: $(PYTHON) is older than 3.11; name a newer one: make PYTHON=python3.12 ..." >&2; exit 2; }
	@if [ ! -x $(BIN)/python ]; then \
	    if uv --version >/dev/null 2>&1; then uv venv -q --python "$$(command -v $(PYTHON))" $(VENV); \
	    else $(PYTHON) -m venv $(VENV) || \
	        { echo "error: no venv here; install uv, or on Debian: apt-get install python3-venv" >&2; exit 2; }; \
	    fi; fi
	@touch $@

# The package itself is installed in place, so only a change of pyproject.toml calls for a new installation.
$(VENV)/.installed: $(VENV)/.created pyproject.toml
	@echo "installing ig2mj and what it needs into $(VENV) (some minutes the first time)"
	@if uv --version >/dev/null 2>&1; then uv pip install -q --python $(BIN)/python -e '.[dev]'; \
	else $(BIN)/python -m pip install -q --disable-pip-version-check -e '.[dev]'; fi
	@touch $@

# OpenGL without a display. Pictures work without it too (Warp's ray caster), so that a failure here is no error.
$(VENV)/.gl: $(VENV)/.created scripts/system_gl.sh
	@sh scripts/system_gl.sh
	@touch $@

# What the page of `ig2mj vr` loads: three.js, in the version of web/package-lock.json. Wheels carry it; the repository
# does not. IWER, which plays a headset in tests, stays in web/node_modules/.
PAGE := src/ig2mj/vr/page/vendor
web: $(PAGE)/three.module.js

$(PAGE)/three.module.js: web/package-lock.json
	@npm --version >/dev/null 2>&1 || { echo "error: no npm here; install Node.js (Debian: apt-get install npm)" >&2; exit 2; }
	@cd web && npm ci --ignore-scripts --no-audit --no-fund --loglevel=error
	@rm -rf $(PAGE) && mkdir -p $(PAGE)/addons/loaders $(PAGE)/addons/utils
	@cp web/node_modules/three/examples/jsm/loaders/GLTFLoader.js $(PAGE)/addons/loaders/
	@cp web/node_modules/three/examples/jsm/utils/BufferGeometryUtils.js $(PAGE)/addons/utils/
	@cp web/node_modules/three/examples/jsm/utils/SkeletonUtils.js $(PAGE)/addons/utils/
	@cp web/node_modules/three/LICENSE $(PAGE)/
	@cp web/node_modules/three/build/three.core.js web/node_modules/three/build/three.module.js $(PAGE)/
	@touch $@

demo: setup
	@$(BIN)/ig2mj demo

# Most of the quick tests' time is XLA's, for programs that then run a few times; so it is told not to optimize them.
# Whoever runs pytest, and the slow tests, get programs as they are elsewhere. Byte code is kept: else both processes, and
# every command that a test starts, compile all modules again.
test: setup
	@PYTHONDONTWRITEBYTECODE= JAX_DISABLE_MOST_OPTIMIZATIONS=1 $(BIN)/python -m pytest -n $(JOBS) --dist loadfile -m "not slow and not gpu" $(PYTEST_ARGS)

test-slow: setup web
	@$(BIN)/python -m pytest -n $(JOBS) --dist loadfile -m "slow and not gpu" --timeout 1800 $(PYTEST_ARGS)

# SETUP=no: with $(PYTHON) as it is, where nothing can be installed. The same command goes on where the last one stopped.
test-gpu: $(if $(filter no,$(SETUP)),,setup)
	@$(if $(filter no,$(SETUP)),$(PYTHON),$(BIN)/python) scripts/gpu_tests.py $(PYTEST_ARGS)

# Each folder of tests/interop/ has the requirements of one environment, and tests that run in it (its README).
test-interop: $(addprefix interop-,$(INTEROP_ENVS))

interop-%: $(INTEROP)/%/.installed setup
	@IG2MJ_PYTHON=$(abspath $(BIN)/python) $(INTEROP)/$*/bin/python -m pytest -c tests/interop/pytest.ini \
	    --rootdir tests/interop --confcutdir tests/interop $(PYTEST_ARGS) tests/interop/$*

# A first line "# python: 3.12" names another Python than the project's.
$(INTEROP)/%/.installed: tests/interop/%/requirements.txt
	@echo "installing $* into $(INTEROP)/$*"
	@python=$$(sed -n '1s/^# python: */python/p' $<); $${python:-$(PYTHON)} -m venv $(INTEROP)/$*
	@$(INTEROP)/$*/bin/python -m pip install -q --disable-pip-version-check pytest pytest-timeout -r $<
	@if [ -f tests/interop/$*/no_dependencies.txt ]; then $(INTEROP)/$*/bin/python -m pip install -q \
	    --disable-pip-version-check --no-deps -r tests/interop/$*/no_dependencies.txt; fi
	@touch $@

.PRECIOUS: $(INTEROP)/%/.installed

check: setup
	@$(BIN)/ruff check
	@$(BIN)/ruff format --check
	@PYRIGHT_PYTHON_IGNORE_WARNINGS=1 $(BIN)/pyright

docs: setup
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet
	@echo "wrote out/site/index.html"

# With a cache of its own, so that nothing is taken from an earlier run.
homes-check: setup
	@set -e; made=$$(mktemp -d); trap 'rm -rf "$$made"' EXIT; \
	$(BIN)/ig2mj homes build --out $$made/dataset; \
	IG2MJ_CACHE_DIR=$$made/cache $(BIN)/ig2mj homes convert --dataset $$made/dataset --out $$made/homes --jobs $(JOBS); \
	$(BIN)/python -m ig2mj_homes.comparison $$made/homes scenes_mjcf; \
	echo "scenes_mjcf/ is what this code builds and converts"

# Needed when an activity, its home or the sampler changes. Success rates of policies are of these start states, and are
# to be measured again then.
pools: setup
	@rm -rf out/pools && $(BIN)/ig2mj sample-task all --out out/pools; test $$? -le 1
	@rm -f pools/*.npz && cp out/pools/*.npz pools/
	@ls -l pools

# Needed when the humanoid, a home or the engine changes: recordings belong to the compiled model.
demonstrations: setup
	@$(BIN)/python scripts/record_demonstrations.py

gallery: setup
	@$(BIN)/python scripts/gallery.py

format: setup
	@$(BIN)/ruff check --fix
	@$(BIN)/ruff format

bench: $(VENV)/.benchmarks
	@set -e; for b in idle_a6 idle_a7 idle_robots states_share; do echo "== $$b"; $(BIN)/python -m benchmarks.speed.$$b; done

$(VENV)/.benchmarks: $(VENV)/.installed $(VENV)/.gl
	@if uv --version >/dev/null 2>&1; then uv pip install -q --python $(BIN)/python -e '.[bench]'; \
	else $(BIN)/python -m pip install -q --disable-pip-version-check -e '.[bench]'; fi
	@touch $@

clean:
	rm -rf build dist out *.egg-info .pytest_cache .ruff_cache .hypothesis MUJOCO_LOG.TXT
	find src converters tests benchmarks -name __pycache__ -type d -prune -exec rm -rf {} + 2>/dev/null || true

distclean: clean
	rm -rf $(VENV)
