# make floor   the main job: environment, then render, detect and score the lab floor into out/floor
# make test    the default tests          make test-all   the long ones too
# make native  the kernels in C, where sources changed; the other targets do it too
# make test-sanitize   the kernels' tests under address and undefined-behaviour sanitizers
# make test-properties   the tests of properties, with many more examples than make test draws and other ones; SEEDS="1 2 3"
# make wheels  dist/*.whl for Linux (x86-64, aarch64), macOS (arm64) and Windows (x86-64), all compiled here
# make release   the source distribution and the wheels, checked, and tried in empty environments
# make check   ruff and mypy              make regress    the detectors on two suites, beside the accepted figures
# make docs    the site, into out/site
# make bench   what users wait for beside tags' detectors and pyrender; SURF's time and memory against OpenCV's and mahotas's, as
#              ratios, beside benchmarks/baseline.json
# make bench-gate   this checkout's speed against that of the commit it branched from; fails where it is slower than noise
# make compare markers and arrays beside tags, rings and corners in the same frames, into out/comparison
# make parity  our key points against OpenCV's own, where cv2 was built with its SURF
PYTHON := .venv/bin/python
PYTEST := $(PYTHON) -m pytest -n auto --dist loadfile --max-worker-restart 0
READY := .venv/.ready
TESTS_READY := .venv/.tests-ready
NATIVE := sim/peaksim/_native/build.json

.PHONY: floor native docs release wheels test test-properties test-sanitize test-all check regress bench bench-gate compare
.PHONY: parity clean

floor: $(READY) $(NATIVE)
	$(PYTHON) scripts/render_floor.py --out out/floor

native: $(NATIVE)

$(NATIVE): $(wildcard native/*.[ch]) tools/build_native.py | $(READY)
	$(PYTHON) tools/build_native.py

test: $(TESTS_READY) $(NATIVE)
	$(PYTEST)

SEEDS := 1 2 3 4 5

test-properties: $(TESTS_READY) $(NATIVE)
	for seed in $(SEEDS); do \
	  $(PYTEST) -m properties --hypothesis-profile properties --hypothesis-seed $$seed || exit; \
	done

test-all: $(TESTS_READY) $(NATIVE)
	$(PYTEST) -m "slow or not slow"

regress: $(TESTS_READY) $(NATIVE)
	for suite in floor cave; do \
	  $(PYTHON) scripts/regress.py run $$suite --quick --quiet --out out/regress/$$suite && \
	  $(PYTHON) scripts/regress.py compare out/regress/$$suite --baseline tests/baselines/$$suite.json \
	    --out out/regress/$$suite/compared || exit; \
	done

check: $(TESTS_READY)
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/mypy

bench: $(READY) $(NATIVE)
	$(PYTHON) -c 'import mahotas' 2>/dev/null || $(PYTHON) -m pip install --quiet --editable '.[bench]'
	$(PYTHON) -c 'import locus, pupil_apriltags, ringgrid, chess_corners' 2>/dev/null || $(PYTHON) -m pip install --quiet --editable '.[compare]'
	$(PYTHON) benchmarks/bench_whole.py
	$(PYTHON) benchmarks/bench_surf.py
	$(PYTHON) benchmarks/bench_render.py

bench-gate: $(READY) $(NATIVE)
	$(PYTHON) tools/bench_gate.py --base $(or $(BASE),main)

compare: $(TESTS_READY) $(NATIVE)
	$(PYTHON) -m peakmark.cli compare --workers 2 --out out/comparison

parity: $(TESTS_READY) $(NATIVE)
	PYTHONPATH=tests $(PYTHON) benchmarks/parity_surf.py

docs: $(READY) $(NATIVE)
	$(PYTHON) -c 'import mkdocstrings, material' 2>/dev/null || $(PYTHON) -m pip install --quiet --editable '.[docs]'
	NO_MKDOCS_2_WARNING=1 $(PYTHON) -m mkdocs build --strict

$(READY): pyproject.toml tools/install.sh
	bash tools/install.sh
	touch $@

$(TESTS_READY): pyproject.toml tools/install.sh
	bash tools/install.sh test
	touch $@ $(READY)

test-sanitize: $(TESTS_READY) $(NATIVE)
	$(PYTHON) -m pytest -m slow tests/test_sanitized.py tests/peakmark/surf/test_bounds.py

wheels: $(READY)
	for target in linux-x86_64 linux-aarch64 macos-arm64 windows-x86_64; do \
	  PEAKMARK_TARGET=$$target $(PYTHON) -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist . || exit; \
	done

release: $(READY)
	$(PYTHON) -c 'import build, twine, check_wheel_contents' 2>/dev/null || \
	  $(PYTHON) -m pip install --quiet --editable '.[release]'
	$(PYTHON) tools/release.py

clean:
	rm -rf out build .pytest_cache .mypy_cache .ruff_cache .hypothesis
