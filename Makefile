# `make demo` sets everything up in ./.venv and runs the main job; `make test` sets up and passes the tests.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
ARGS ?=
# Tests start hundreds of processes: where compiled modules are not kept, each of them compiles SciPy and the like anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test campaigns install web site wheel sdist other-build sanitize lint check-systems docs viewer page-checks check-tools clean
.DEFAULT_GOAL := demo

check-tools:
	@command -v cargo >/dev/null || { echo "Rust is missing: install it from https://rustup.rs"; exit 1; }
	@command -v cc >/dev/null || { echo "A C compiler is missing: install gcc or clang (Debian: apt install build-essential)"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null || { echo "Python 3.10 or later is missing (set PYTHON=...)"; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || { echo "Python's venv is missing (Debian: apt install python3-venv)"; exit 1; }
	@command -v node >/dev/null && command -v npm >/dev/null || { echo "Node.js with npm is missing (version 20 or later): https://nodejs.org"; exit 1; }
	@node -e 'process.exit(Number(process.versions.node.split(".")[0]) < 20 ? 1 : 0)' || { echo "Node.js 20 or later is needed"; exit 1; }

$(BIN)/python: | check-tools
	$(PYTHON) -m venv $(VENV)

# The extension is rebuilt when a source changes; cargo itself decides how much. Python compiles the modules that it
# imports, a small part of what pip would.
$(VENV)/.installed: $(BIN)/python pyproject.toml Cargo.toml Cargo.lock $(shell find crates -name '*.rs' -o -name Cargo.toml)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check "maturin>=1.9,<2"
	. $(BIN)/activate && PIP_NO_COMPILE=1 maturin develop --release --quiet --extras test >$(VENV)/build.log 2>&1 || { cat $(VENV)/build.log; exit 1; }
	@touch $@

# The page of the viewer, served by the package.
PAGE := python/palpate/viewer/static/index.html
NPM_CI := npm ci --no-audit --no-fund --loglevel=error
viewer/node_modules/.package-lock.json: viewer/package.json viewer/package-lock.json | check-tools
	cd viewer && $(NPM_CI) --omit=dev
	@touch $@

$(PAGE): $(BIN)/python viewer/node_modules/.package-lock.json $(shell find viewer/src viewer/public -type f) viewer/index.html viewer/vite.config.ts $(wildcard viewer/tsconfig*.json)
	cd viewer && npm run --silent build >../$(VENV)/viewer.log 2>&1 || { cat ../$(VENV)/viewer.log; exit 1; }

# The linter and the tests of the page take five times as many packages as building it, which is not to be done again.
viewer/node_modules/.checks: viewer/node_modules/.package-lock.json | $(PAGE)
	cd viewer && $(NPM_CI)
	@touch -r $(PAGE) $< && touch $@

viewer: $(PAGE)

page-checks: $(PAGE) viewer/node_modules/.checks
	cd viewer && npm run --silent check

# The program of pages without a server (docs/web.md): WebAssembly, for whose target scripts/build_web.sh cares.
WEB := python/palpate/viewer/web/palpate.wasm
WEB_CRATES := core devices servo recording scene web
$(WEB): Cargo.lock scripts/build_web.sh $(shell find $(WEB_CRATES:%=crates/%) -name '*.rs' -o -name Cargo.toml)
	scripts/build_web.sh $@

web: $(WEB)

# A gallery for any web host, docs/_site: the built-in bodies and examples (docs/web.md).
SITE ?= docs/_site
SITE_SCENES := liver kidney doll beam $(addprefix examples/,nodule.toml large_strain.toml impact.toml two_bodies.toml)
site: $(VENV)/.installed $(PAGE) $(WEB)
	$(BIN)/palpate web $(SITE_SCENES) $(SITE) --precision f16
	$(BIN)/python scripts/check_site.py $(SITE)

# libpalpate for programs in C and C++: library, header, pkg-config, CMake (docs/c-api.md).
PREFIX ?= /usr/local
install:
	scripts/install_c.sh $(PREFIX)

# What `pip install palpate` takes: a wheel for all Pythons from 3.10 on, with the page inside (docs/install.md).
# `make wheel WHEEL_ARGS="--zig --compatibility manylinux_2_28"` builds for older systems than this one.
WHEEL_ARGS ?=
MATURIN := $(BIN)/python -m maturin
PACKAGERS := $(BIN)/python -m pip install --quiet --disable-pip-version-check "maturin[zig]>=1.9,<2" "auditwheel>=6"
wheel: $(BIN)/python $(PAGE) $(WEB)
	$(PACKAGERS)
	$(MATURIN) build --release --strip --quiet --out dist $(WHEEL_ARGS)
	$(BIN)/python scripts/check_wheel.py dist

sdist: $(BIN)/python $(PAGE) $(WEB)
	$(PACKAGERS)
	$(MATURIN) sdist --quiet --out dist

demo: $(VENV)/.installed $(PAGE)
	$(BIN)/palpate demo $(ARGS)

# OpenBLAS on one thread each: its threads wait for one another by spinning, which took two thirds of the tests of modes.
PYTEST := OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest --quiet --dist loadgroup --no-loadscope-reorder
# --tests leaves out documentation, which holds none; --lib would build crates of which nothing is tested so.
CARGO_TEST := cargo test --release --quiet --workspace --tests
test: | check-tools
	@# npm and pip wait for downloads while cargo compiles, and the extension for the tests to be compiled.
	$(CARGO_TEST) --no-run & \
		$(MAKE) --no-print-directory page-checks $(VENV)/.installed; status=$$?; \
		wait $$! && exit $$status
	$(CARGO_TEST)
	@# Three processes: much of the time goes into waiting for browsers, meshers and servers; tests/python/conftest.py gives what
	@# each of them takes on, and in which order.
	$(PYTEST) --numprocesses 3 -m "not slow" $(ARGS)

# Slow tests and campaigns of random touches, presses, writers and answers. CI runs a thirty-second of their files after `make
# test`, with a share of the cases; `make campaigns ARGS=--whole` takes all, about an hour.
campaigns: $(VENV)/.installed $(PAGE) $(WEB)
	$(PYTEST) --numprocesses 2 -m slow $(ARGS)

# After `make test`: what the release build has recorded, a build that is not optimised makes again bit for bit.
OTHER_BUILD := -p palpate-servo --no-default-features --test across_builds
other-build:
	cargo test --quiet --config profile.dev.opt-level=0 $(OTHER_BUILD)

# The same, and unordered accesses between the loop's thread and others, by ThreadSanitizer of a nightly toolchain.
sanitize:
	RUSTFLAGS="-Zsanitizer=thread -Cunsafe-allow-abi-mismatch=sanitizer" cargo +nightly test --quiet --config profile.dev.opt-level=0 \
		--target $$(rustc -vV | sed -n 's/host: //p') $(OTHER_BUILD) --test handoff

# What compilers and linters object to; clippy takes as long as a build.
lint: $(VENV)/.installed
	cargo fmt --all --check
	cargo clippy --release --quiet --workspace --all-targets -- -D warnings
	cargo clippy --release --quiet -p palpate-core -p palpate-servo --no-default-features -- -D warnings
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python scripts/check_architecture.py
	$(BIN)/python scripts/check_words.py

# Windows and macOS, as far as their compilers are not needed.
check-systems:
	scripts/check_systems.sh

# The site, docs/_build/html/index.html: the reference is generated from the program, the tutorials are run, warnings are
# errors; scenes inside tutorials are the page and its program. Nothing is taken from the network once the packages are there.
# `make docs NOTEBOOKS=cache` runs changed tutorials only.
NOTEBOOKS ?= force
$(VENV)/.docs: $(VENV)/.installed pyproject.toml
	$(BIN)/python -c 'from importlib.metadata import requires; print(*[r.split(";")[0] for r in requires("palpate") if "docs" in r], sep="\n")' \
		| $(BIN)/python -m pip install --quiet --disable-pip-version-check -r /dev/stdin
	@touch $@

docs: $(VENV)/.docs $(PAGE) $(WEB)
	$(BIN)/python -m sphinx -b html -q -W --keep-going -j auto -D nb_execution_mode=$(NOTEBOOKS) docs docs/_build/html

clean:
	rm -rf docs/_build docs/_site docs/reference target $(VENV) viewer/node_modules python/palpate/viewer/static python/palpate/viewer/web
