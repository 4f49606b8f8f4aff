# make floor   the main job: environment, then render, detect and score the lab floor into out/floor
# make test    the default tests          make test-all   the long ones too
# make check   ruff and mypy
PYTHON := .venv/bin/python
READY := .venv/.ready

.PHONY: floor test test-all check clean

floor: $(READY)
	$(PYTHON) scripts/render_floor.py --out out/floor

test: $(READY)
	$(PYTHON) -m pytest

test-all: $(READY)
	$(PYTHON) -m pytest -m "slow or not slow"

check: $(READY)
	.venv/bin/ruff check .
	.venv/bin/mypy

$(READY): pyproject.toml tools/install.sh
	bash tools/install.sh
	touch $@

clean:
	rm -rf out .pytest_cache .mypy_cache .ruff_cache .hypothesis
