# Every target does its own set-up in .venv and needs only make, Python 3.11 or later and a C++20 compiler.
#
#   make demo    track detections, and go from simulated pictures and events to tracks on a film (in demo/)
#   make test    run the tests, those of time by themselves
#   make test-slow   run those that make test leaves out: endurance, destruction, training
#   make test-all    run both
#   make test-portable   run the numerical tests with other kernels, in random order (SEED=... repeats one)
#   make benchmark   run the benchmark KIND=real, speed, ... with ARGS='...'
#   make licences   list the licences of everything installed with the package
#   make fuzz    the long form of the tests that damage files, streams and processes (an hour)
#   make live    the long form of the tests of live use: kills, brokers, late data (half an hour)
#   make lint    style, format, docstrings, faults of C++, and known weaknesses of what is installed
#   make types   type-check the built packages and the benchmarks
#   make bounds  run the numerical tests with the oldest versions allowed of what is needed
#   make core    build what is compiled, after a change of it
#   make sanitize   run the tests of what is compiled with AddressSanitizer and UndefinedBehaviorSanitizer
#   make marches   compare what the core computes when built for the oldest processors and for this one
#   make build   build the wheels (in dist/)
#   make reproducible   build the last commit twice, wheels and sources: the same bytes (in build/reproducible/first)
#   make sbom    write the list of what the wheel needs and holds (CycloneDX, in dist/)
#   make docs    build the documentation (in docs/_build/html)
#   make clean   remove what was built and computed, .venv included

PYTHONS := python3 python3.13 python3.12 python3.11
PYTHON ?= $(firstword $(foreach name,$(PYTHONS),$(shell $(name) -c \
	'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $(name))))
VENV := .venv
BIN := $(VENV)/bin
# Without the bytecode of all that comes along, which takes as long as the rest; what is used is compiled then, ...
PIP := $(BIN)/python -m pip install -qq --disable-pip-version-check --no-compile
# ... and kept, though some images forbid it: each of many processes would compile it anew.
export PYTHONDONTWRITEBYTECODE :=
# The build without what GPUs need, which takes gigabytes. Where pip does not find it by itself, give PIP_EXTRA_INDEX_URL
# the address of PyTorch's index for processors.
TORCH := torch==2.13.0+cpu
# The time of all files in wheels: that of the last commit, so that a later build gives the same bytes.
export SOURCE_DATE_EPOCH ?= $(shell git log -1 --format=%ct 2> /dev/null || date +%s)
CORE := $(shell find jeat_graph/core -name '*.?pp' -o -name CMakeLists.txt)
CPP := $(shell find jeat_graph/core tests/core -name '*.?pp')
SOURCES := $(shell find jeat_graph filters association smoothers eval -name '*.py')
# What is no part of the tracker's distribution: the simulator and training, and the benchmarks.
BESIDE := $(shell find sehn/jeat_graph_sehn benchmarks -name '*.py' -o -name '*.yaml')

# Other kernels than this machine would choose: the oldest of OpenBLAS, none of NumPy's for newer processors.
NUMERICAL := tests/association tests/calibration tests/config tests/eval tests/filters \
	tests/smoothers tests/tracking
SEED ?= $(shell date +%s)
OTHER_KERNELS = OPENBLAS_CORETYPE=$(if $(filter x86_64 AMD64,$(shell uname -m)),Prescott,ARMV8) \
	NPY_DISABLE_CPU_FEATURES="$$($(BIN)/python .ci/kernels.py names)"

DOCUMENTED := jeat_graph filters association smoothers eval configs sehn/jeat_graph_sehn benchmarks

.PHONY: demo test test-slow test-all installed-for-tests test-portable benchmark licences live fuzz lint types bounds core \
	sanitize marches build reproducible sbom docs clean
.DELETE_ON_ERROR:

demo: $(VENV)/.core $(VENV)/.sehn
	@$(BIN)/jeat-graph demo --from-raw --out demo

test: installed-for-tests
	@echo "make: running the tests"
	@$(BIN)/python -m pytest -p no:randomly -n 2 --dist worksteal -m "not slow"
	@$(BIN)/python -m pytest -p no:randomly -n 0 -m "not slow" tests/performance/test_time.py

test-slow: installed-for-tests
	@echo "make: running the slow tests"
	@$(BIN)/python -m pytest -p no:randomly -n 2 --dist worksteal -m slow
	@$(BIN)/python -m pytest -p no:randomly -n 0 -m slow tests/performance/test_time.py

installed-for-tests: $(VENV)/.test $(VENV)/.core

# One after the other, also with make -j: both would wait for each other's processor time.
test-all: test
	@$(MAKE) --no-print-directory test-slow

test-portable: $(VENV)/.test $(VENV)/.core
	@echo "make: running the numerical tests with other kernels, SEED=$(SEED)"
	@$(OTHER_KERNELS) $(BIN)/python .ci/kernels.py check
	@$(OTHER_KERNELS) $(BIN)/python -m pytest -n 2 --randomly-seed=$(SEED) $(NUMERICAL)

benchmark: $(VENV)/.run $(VENV)/.sehn
	@$(BIN)/python -m benchmarks $(KIND) $(ARGS)

licences: $(VENV)/.test
	@$(BIN)/python .ci/licences.py

live: $(VENV)/.test $(VENV)/.core
	@JEAT_GRAPH_FULL=1 $(BIN)/python -m pytest tests/live

fuzz: $(VENV)/.test $(VENV)/.core
	@JEAT_GRAPH_FULL=1 $(BIN)/python -m pytest -n 2 tests/fuzz tests/tracking/test_invariants.py

lint: $(VENV)/.lint $(VENV)/.core $(VENV)/.sehn
	@$(BIN)/ruff check
	@$(BIN)/ruff format --check
	@$(BIN)/clang-format --dry-run --Werror $(CPP)
	@$(BIN)/python .ci/tidy.py
	@$(BIN)/interrogate --quiet $(DOCUMENTED) || $(BIN)/interrogate -v $(DOCUMENTED)
	@$(BIN)/python .ci/prose.py
	@$(BIN)/python .ci/audit.py
	@$(BIN)/check-jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml
	@$(BIN)/check-jsonschema --builtin-schema vendor.readthedocs .readthedocs.yaml
	@$(BIN)/zizmor --offline --no-progress --quiet .github
	@$(BIN)/shellcheck .ci/run .ci/bounds .ci/sanitize .ci/reproducible

# The folders at the top of the repository become one package only when it is built, so that is what is checked;
# the benchmarks, which are not, are looked at through a link.
types: build/.installed
	@ln -sfn ../benchmarks build/benchmarks
	@cd build && venv/bin/mypy --config-file ../pyproject.toml --cache-dir ../.mypy_cache \
		-p jeat_graph -p jeat_graph_sehn -p benchmarks

bounds: | $(BIN)/python
	@PYTHON=$(BIN)/python .ci/bounds

core: $(VENV)/.core

# What is compiled, built with the sanitizers and the checks of the C++ library, in a copy of the package.
sanitize: $(VENV)/.test $(VENV)/.core
	@echo "make: building the core with the sanitizers"
	@PYTHON=$(BIN)/python .ci/sanitize

# The same bits from a core for the oldest processors and from one for this very processor.
marches: $(VENV)/.core
	@echo "make: comparing the core for the oldest processors with that for this one"
	@PYTHON=$(BIN)/python .ci/marches

build: build/.wheel

reproducible: $(VENV)/.run
	@$(PIP) 'build>=1.2,<2' 'hatchling>=1.27,<2'
	@PYTHON=$(BIN)/python .ci/reproducible

# In an environment of its own: what else is installed beside the wheel is no part of it.
sbom: build/.wheel $(VENV)/.run
	@$(PIP) 'cyclonedx-bom>=7,<8'
	@$(PYTHON) -m venv --clear build/sbom
	@build/sbom/bin/python -m pip install -qq --disable-pip-version-check --no-compile dist/jeat_graph-*.whl
	@$(BIN)/python .ci/sbom.py build/sbom/bin/python \
		"$$(ls dist/jeat_graph-*.whl | sed 's/-cp.*//').cdx.json"

# A warning is an error: a link or a name that leads nowhere.
docs: $(VENV)/.docs
	@$(BIN)/python -m sphinx -q -W --keep-going -b html docs docs/_build/html
	@echo "make: open docs/_build/html/index.html"

clean:
	rm -rf $(VENV) build dist demo docs/_build *.egg-info sehn/build sehn/*.egg-info jeat_graph/core/_core jeat_graph/core/_core.* .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(BIN)/python:
	@test -n "$(PYTHON)" || { echo "make: Python 3.11 or later is needed; set PYTHON=/path/to/python" >&2; exit 1; }
	@echo "make: creating $(VENV)"
	@$(PYTHON) -m venv $(VENV)

# Without a build environment of its own, so that the next build goes on where the last one ended. CMake and Ninja
# come along where the machine has none.
$(VENV)/.run: pyproject.toml | $(BIN)/python
	@echo "make: installing jeat-graph and what it needs (a minute or two)"
	@$(PIP) $$($(BIN)/python -c "import tomllib; \
		print(*tomllib.load(open('pyproject.toml', 'rb'))['build-system']['requires'])") \
		$$(command -v cmake > /dev/null || echo cmake) $$(command -v ninja > /dev/null || echo ninja)
	@$(PIP) --no-build-isolation --editable .
	@touch $@ $(VENV)/.core

$(VENV)/.core: $(CORE) $(VENV)/.run
	@echo "make: building the core"
	@$(PIP) --no-build-isolation --no-deps --editable .
	@touch $@

# By its path: it is in no index.
$(VENV)/.sehn: sehn/pyproject.toml $(VENV)/.run
	@echo "make: installing jeat-graph-sehn, the simulator"
	@$(PIP) --editable ./sehn
	@touch $@

$(VENV)/.test: pyproject.toml sehn/pyproject.toml $(VENV)/.run
	@echo "make: installing what the tests need"
	@$(PIP) --no-build-isolation --editable '.[test]'
	@$(PIP) --editable './sehn[test]'
	@$(PIP) --no-deps 'trackers>=2.6,<3' norfair==2.3.0 'trackeval>=1.3,<2'
	@$(PIP) $(TORCH) 2> /dev/null || \
		echo "make: no PyTorch for processors to be had: the tests of training skip"
	@touch $@

$(VENV)/.docs: pyproject.toml $(VENV)/.run $(VENV)/.sehn
	@echo "make: installing what builds the documentation"
	@$(PIP) --no-build-isolation --editable '.[docs]'
	@touch $@

$(VENV)/.lint: pyproject.toml | $(BIN)/python
	@echo "make: installing the linters"
	@$(BIN)/python -c "import tomllib; extras = tomllib.load(open('pyproject.toml', 'rb'))['project']; \
		print(*extras['optional-dependencies']['lint'], sep='\n')" > $(VENV)/lint.txt
	@$(PIP) -r $(VENV)/lint.txt
	@touch $@

build/.wheel: $(SOURCES) $(CORE) $(BESIDE) $(shell find configs -type f -not -name '*.pyc') pyproject.toml sehn/pyproject.toml | $(BIN)/python
	@echo "make: building the wheels"
	@$(PIP) build
	@rm -rf dist
	@$(BIN)/python -m build --wheel --outdir dist . > $(VENV)/build.log 2>&1 || { cat $(VENV)/build.log; exit 1; }
	@$(BIN)/python -m build --wheel --outdir dist sehn > $(VENV)/build.log 2>&1 || { cat $(VENV)/build.log; exit 1; }
	@mkdir -p build && touch $@

build/.installed: build/.wheel
	@echo "make: installing the wheels into build/venv"
	@$(PYTHON) -m venv --clear build/venv
	@build/venv/bin/python -m pip install -qq --disable-pip-version-check --no-compile "$$(ls dist/jeat_graph-*.whl)[lint]" dist/jeat_graph_sehn-*.whl
	@touch $@
