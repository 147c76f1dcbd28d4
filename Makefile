# Two targets matter to a newcomer: `make demo` and `make test`. Both set up .venv by themselves.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
WHEELS := dist
STAMP  := $(VENV)/.installed
# One worker a core; a linear-algebra library that starts threads of its own would only get in the way.
JOBS   ?= auto
FOLDER ?= .
FUZZ_RUNS ?= 1000000
FUZZ_TARGETS = $(basename $(notdir $(wildcard fuzz/fuzz_targets/*.rs)))

# Rewritten asserts are kept between runs, whatever the shell says of byte code.
PYTEST = PYTHONDONTWRITEBYTECODE= OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest
STARTED = -n $(JOBS) --dist worksteal
# Forked processes share what one of them collected; where a fork is not safe, each is started.
SPREAD := $(if $(filter Linux,$(shell uname -s)),-p tests.forks --forks $(JOBS),$(STARTED))
# A test that waits for good says where, and ends the run.
PATIENT = -o faulthandler_timeout=300 -o faulthandler_exit_on_timeout=true

.PHONY: demo app test test-slow test-nightly docs fuzz fuzz-files kills mutants same-wheel bench lint hooks format stubs develop wheel constraints clean help

help:  ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/ —/'

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) tools/check_machine.py
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python tools/install_dependencies.py app dev docs
	touch $@

develop: $(STAMP)  ## build the native half in place, for working on the code
	$(BIN)/maturin develop --release --quiet

wheel: $(STAMP)  ## build the wheel and install exactly that wheel
	rm -rf $(WHEELS)
	$(BIN)/python tools/build_page.py
	$(BIN)/maturin build --release --quiet --out $(WHEELS)
	$(BIN)/python tools/build_page.py --in $(WHEELS)/*.whl
	rm -f src/flightid/_native*.so
	$(BIN)/python -m pip install --quiet --force-reinstall --no-deps $(WHEELS)/*.whl

demo: wheel  ## fly a simulated quadrotor, identify it from its log, write a report to look at
	$(BIN)/flightid run examples/quadrotor_rig/study.toml --output demo-output

app: wheel  ## open the local page on FOLDER (default: here): drop a log, look, identify
	$(BIN)/flightid app $(FOLDER)

lint: $(STAMP)  ## formatting, lints and types of both halves
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	cargo fmt --all --check
	cargo clippy --workspace --all-targets --quiet -- -D warnings

hooks: $(STAMP)  ## check every commit of this clone before it is made
	$(BIN)/pre-commit install

format: $(STAMP)  ## lay out the code and mend what can be mended
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .
	cargo fmt --all

stubs: develop  ## regenerate src/flightid/_native.pyi
	$(BIN)/python tools/stubs.py --write

test: wheel lint  ## everything that must pass before a merge
	cargo test --workspace --quiet
	@command -v chromium google-chrome >/dev/null || echo "No Chromium: the page is not tried in a browser (apt-get install chromium)"
	$(PYTEST) $(SPREAD) $(PATIENT) --doctest-modules tests --pyargs flightid

test-nightly: wheel  ## every example whole and longer draws of properties, minutes; then what test-slow does
	HYPOTHESIS_PROFILE=nightly $(PYTEST) $(STARTED) -m "nightly or slow or hypothesis"

test-slow: wheel  ## Monte Carlo calibration of every printed interval, and the full studies
	$(PYTEST) $(STARTED) -m slow

docs: wheel  ## build the documentation site into build/site, warnings as errors
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet

bench: wheel  ## speed against peers, same data, one run
	$(BIN)/python -m benchmarks

same-wheel:  ## build the wheel in two folders and compare the bytes
	rm -rf build/twice && mkdir -p build/twice/elsewhere
	git ls-files -z | tar --null -T - -c | tar -x -C build/twice/elsewhere
	! test -d src/flightid/app/page || cp -R src/flightid/app/page build/twice/elsewhere/src/flightid/app/
	SOURCE_DATE_EPOCH=315532800 $(BIN)/maturin build --release --quiet --out build/twice/a
	cd build/twice/elsewhere && SOURCE_DATE_EPOCH=315532800 $(abspath $(BIN))/maturin build --release --quiet --out ../b
	for wheel in build/twice/a/*.whl; do cmp $$wheel build/twice/b/$$(basename $$wheel) || exit 1; done

kills: develop  ## kill commands at 200 random moments and look for losses
	$(BIN)/python -m tests.stress.kills --kills 200

mutants: develop  ## change what tells users what to believe, and count what no test notices
	$(BIN)/python tools/install_dependencies.py app dev mutants
	$(BIN)/python -m tests.stress.mutants --sample 200 --keep build/mutants.jsonl

fuzz-files: develop  ## throw damaged files at the Python readers, in children with limits
	$(BIN)/python -m tests.fuzz --runs $(FUZZ_RUNS) --keep build/fuzz

fuzz: fuzz-files  ## and damaged logs, sheets, formulas and models at the native ones, address sanitiser on
	cd fuzz && RUSTC_BOOTSTRAP=1 cargo build --release --quiet --target-dir target
	cd fuzz && for target in $(FUZZ_TARGETS); do \
	  mkdir -p corpus/$$target seeds/$$target && target/*/release/$$target -runs=$(FUZZ_RUNS) \
	    -max_len=4096 -detect_leaks=0 corpus/$$target seeds/$$target || exit 1; done

constraints: $(STAMP)  ## note the installed versions as the ones that `make` installs
	head -2 constraints.txt > constraints.new
	$(BIN)/python -m pip freeze --exclude flightid >> constraints.new
	mv constraints.new constraints.txt

clean:
	rm -rf $(VENV) $(WHEELS) target build demo-output
