# Two commands do everything on a fresh machine: make demo, make test. The rest is for developers.
# make test finds most mistakes in minutes; make test-slow has the rest of the tests, make test-all both.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready
DOCS   := $(VENV)/.docs
# One thread for each FFT or BLAS call: parallelism is over independent blocks of work.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1
export MKL_NUM_THREADS := 1
# Compiled modules are kept, those of the tests too: to compile them takes longer than many a test.
unexport PYTHONDONTWRITEBYTECODE

# Folders of tests that many random epochs, real data or other programs make slow, and files with single slow tests.
SLOW   := $(addprefix tests/,agreement browser golden paper statistical)
MARKED := $(shell grep -rl --include='test_*.py' 'mark\.slow' tests)
# A worker takes whole files, so that what the tests of a file share is computed once; long ones come first.
PYTEST := $(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

# An independent program in Python that judges I/NAV and OSNMA in tests/agreement. Its own dependencies (notebook, cartopy and more)
# are left out, because the parts that the tests import do not need them.
JUDGES := cssrlib==1.2.1 bitstruct==8.24.0 galois==0.4.11 crccheck==1.3.1

.PHONY: setup judges demo docs docs-quick test test-slow test-all fuzz lint types arch fmt constraints clean

setup: $(READY)

$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "vestige needs Python 3.11 or newer, found " + sys.version.split()[0])'
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'
	@touch $@

judges: $(READY)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps $(JUDGES)
	@$(BIN)/python -c 'import cssrlib.osnma, cssrlib.rawnav'

# What Sphinx needs is installed by the first `make docs` only.
$(DOCS): $(READY) pyproject.toml constraints.txt
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[docs]'
	@touch $@

# The documentation site, in build/docs/html. docs-quick runs only the two examples of the front page.
docs: $(DOCS)
	@$(BIN)/python docs/site/build.py

docs-quick: $(DOCS)
	@$(BIN)/python docs/site/build.py --quick

demo: $(READY)
	@rm -rf build/demo
	@$(BIN)/vestige demo -o build/demo

test: $(READY)
	@$(PYTEST) -m 'not slow' $(addprefix --ignore=,$(SLOW))

test-slow: $(READY)
	@$(PYTEST) -m slow $(SLOW) $(MARKED)

test-all:
	@$(MAKE) --no-print-directory test
	@$(MAKE) --no-print-directory test-slow

# Spoiled inputs for every reader. INPUTS=…, SEED=…, TARGET=… (one reader) or REPLAY=… (one input that was kept).
INPUTS ?= 100000
fuzz: $(READY)
	@PYTHONPATH=tests $(BIN)/python -m fuzz --inputs $(INPUTS) $(if $(SEED),--seed $(SEED)) \
	  $(if $(TARGET),--target $(TARGET)) $(if $(REPLAY),--replay $(REPLAY))

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python -m pytest tests/architecture/test_plain_english.py

types: $(READY)
	$(BIN)/mypy

arch: $(READY)
	$(BIN)/lint-imports

fmt: $(READY)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# Refresh the exact versions that development and CI install.
constraints:
	rm -rf build/constraints && $(PYTHON) -m venv build/constraints
	build/constraints/bin/python -m pip install --quiet '.[dev,docs]'
	build/constraints/bin/python -m pip freeze --exclude vestige > constraints.txt

clean:
	rm -rf $(VENV) build .pytest_cache .mypy_cache .ruff_cache .hypothesis
