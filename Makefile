# `make demo` and `make test` are all that is needed on a machine with Python 3.11 or 3.12.
# They fetch uv if it is missing and build the locked environment in .venv.

UV ?= $(or $(shell command -v uv),.uv/bin/uv)
PYTHON ?= $(or $(shell command -v python3.11),$(shell command -v python3.12),python3)
BIN := .venv/bin
READY := .venv/.ready
FAST := tests/protocol tests/device $(addprefix tests/runner/,journal people session study) \
	$(addprefix tests/analysis/,loading statistics trials)

.PHONY: demo test test-computing test-waiting test-fast check bench docs paper pictures soak mutants day-mutants clean
.DELETE_ON_ERROR:

demo: $(READY)
	@$(BIN)/touchbeam demo

# Tests that wait leave the cores to those that compute, and go first where they need one: a session
# in real time misses answers on a busy core. Three at a time use about one core; with two cores, more
# workers that compute win hardly anything.
# Workers share the compiled tests, also where Python is told to write none.
test: export PYTHONDONTWRITEBYTECODE =
test: $(READY)
	@.ci/system-packages
	@$(MAKE) --no-print-directory --keep-going --jobs 3 check test-computing test-waiting

# A file's tests share sessions, so they stay on one worker.
test-waiting: $(READY)
	@$(BIN)/pytest -m "waits and not soak" --numprocesses 3 --dist loadfile --no-loadscope-reorder \
		--durations 10 >.waiting.log 2>&1; code=$$?; cat .waiting.log; rm .waiting.log; exit $$code

test-computing: $(READY)
	nice $(BIN)/pytest -m "not waits and not soak" --numprocesses logical --maxprocesses 4 \
		--dist worksteal --durations 10

# What needs no other process, window, report or fit, while you work: a quick first answer.
test-fast: $(READY)
	$(BIN)/pytest -m "not waits and not soak" --numprocesses logical --maxprocesses 4 \
		--dist worksteal --durations 10 $(FAST)

check: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	nice $(BIN)/mypy
	nice $(BIN)/lint-imports

# The table at its end is also docs/reference/benchmarks.md. Let the machine do nothing else meanwhile.
bench: $(READY)
	$(BIN)/pytest benchmarks --benchmark-only --page docs/reference/benchmarks.md

# Pictures of every page of the participant's window, of the console and of a report, for the documentation.
pictures: $(READY)
	@.ci/system-packages
	$(BIN)/python -m tests.runner.window.pictures docs/window
	$(BIN)/python -m tests.runner.people.picture docs/pictures/console.svg
	$(BIN)/python -m tests.analysis.picture docs/pictures/report.png

# The documentation as a site, site/index.html: it needs no server and no network.
docs: $(READY)
	$(BIN)/python -m handbook.reference
	$(BIN)/python -m handbook.build

# The paper's figures and claims, computed again: docs/paper.md.
paper: $(READY)
	$(BIN)/python -m handbook.paper

soak: $(READY)
	$(BIN)/pytest -m soak -s

# Small errors in the code that guards data and finger: the tests must find them. It takes hours and
# goes on where it was stopped; `make mutants ONLY=device/rig.py` tries one module.
mutants: $(READY)
	$(BIN)/python -m tests.mutants.run $(ONLY)

# A hundred of them: simulated days must find them, too.
day-mutants: $(READY)
	$(BIN)/python -m tests.system.day.mutants

clean:
	rm -rf .venv .uv .mutants dist site

# Compiled here once, so that no command starts slowly where Python may not write beside its modules.
# What tests and tools import is compiled where it is imported first, but for what every worker does.
$(READY): pyproject.toml uv.lock | $(UV)
	@echo "Installing the packages that touchbeam needs into .venv, about 1 GB ..."
	@[ -t 2 ] || quiet=--quiet; $(UV) sync --frozen $$quiet --no-dev --inexact
	@$(BIN)/python -m compileall -qq -j 0 -x '/tests/' .venv/lib || true # some are templates
	@[ -t 2 ] || quiet=--quiet; $(UV) sync --frozen $$quiet
	@$(BIN)/python -m compileall -q -j 0 -x '/test_[^/]*$$' protocol device runner analysis touchbeam tests \
		$(addprefix .venv/lib/python*/site-packages/,_pytest execnet hypothesis pluggy xdist)
	@touch $@

# Debian ships Python without venv; the package that brings it is the only thing ever installed here.
.uv/bin/uv:
	@echo "Installing uv, which installs the packages, into .uv ..."
	@$(PYTHON) -m venv .uv >/dev/null || { rm -rf .uv; echo "Installing python3-venv ..."; \
		apt-get install --yes --quiet python3-venv && $(PYTHON) -m venv .uv; }
	@.uv/bin/pip install --quiet --disable-pip-version-check 'uv>=0.9'
