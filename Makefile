# One way in: `make run` does the main job, `make test` checks everything. Each makes .venv first, if needed.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
OUT    ?= out
FUZZ_SECONDS ?= 60

.DEFAULT_GOAL := help
STUDY_OUT ?= docs

.PHONY: help run test test-slow lint bench fuzz study-noise study-effects study-parking study-field samples schemas clean

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 22

run: $(VENV)/.ready ## set up if needed, then calibrate sample_logs/ into out/
	@$(BIN)/sccal calibrate sample_logs --out $(OUT)

test: $(VENV)/.ready-dev lint ## set up if needed, then lint, type-check and test
	$(BIN)/python -m pytest -n auto --dist worksteal -m "not slow"

test-slow: $(VENV)/.ready-dev ## the tests that make test leaves out for their length
	$(BIN)/python -m pytest -n auto -m slow

lint: $(VENV)/.ready-dev ## ruff (style and format) and mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(VENV)/.ready-dev ## time the filter, the readers and the whole command
	$(BIN)/python -m benchmarks

fuzz: $(VENV)/.ready-dev ## feed broken logs to every reader for FUZZ_SECONDS (60)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check "atheris>=3"
	$(BIN)/python -m fuzz --seconds $(FUZZ_SECONDS)

study-noise: $(VENV)/.ready-dev ## 200 effect-free logs of another simulator: noise, verdicts, findings (an hour)
	$(BIN)/python -m studies noise --out $(STUDY_OUT)/study-noise.md

study-effects: $(VENV)/.ready-dev ## every effect alone, and 60 pairs and triples (two hours)
	$(BIN)/python -m studies effects --out $(STUDY_OUT)/study-effects.md

study-parking: $(VENV)/.ready-dev ## a robot that parks for up to an hour: the same constants
	$(BIN)/python -m studies parking --out $(STUDY_OUT)/study-parking.md

study-field: $(VENV)/.ready-dev ## logs as people really write them: 300 situations with known truth (40 minutes)
	$(BIN)/python -m studies field --out $(STUDY_OUT)/study-field.md

samples: $(VENV)/.ready ## make sample_logs/ anew (seeded: the same bytes every time)
	$(BIN)/sccal simulate --samples sample_logs

schemas: $(VENV)/.ready ## write the JSON Schema of every document into docs/schemas/
	$(BIN)/python docs/schemas.py

clean: ## remove the environment, caches and results
	rm -rf $(VENV) $(OUT) .pytest_cache .mypy_cache .ruff_cache .hypothesis dist build
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# uv is only a faster installer; where it cannot be had, pip does the same.
$(VENV)/.ready: pyproject.toml
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check uv 2>/dev/null \
	  && $(BIN)/uv pip install --quiet --compile-bytecode --python $(BIN)/python -e . \
	  || $(BIN)/python -m pip install --quiet --disable-pip-version-check -e .
	@$(BIN)/python -m compileall -q sccal || true
	@touch $@

$(VENV)/.ready-dev: $(VENV)/.ready pyproject.toml
	@$(BIN)/uv pip install --quiet --python $(BIN)/python --group dev 2>/dev/null \
	  || { $(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade "pip>=25.1" \
	  && $(BIN)/python -m pip install --quiet --disable-pip-version-check --group dev; }
	@touch $@
