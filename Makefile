# Everything runs inside .venv, which the first target that needs it makes.
PYTHON ?= python3
BIN := .venv/bin
# Byte code is kept whatever the environment says: tests start many processes, which else compile every module.
# A process that ends by itself ends the run: pytest-xdist 3.8 would wait for ever for the groups that it held.
TESTS := PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n auto --maxprocesses 4 --dist loadgroup --max-worker-restart 0

.PHONY: demo pictures studio-pictures docs test test-all check other-versions benchmark accuracy fleet field figures hosts clean

demo: .venv/installed
	$(BIN)/lutforge demo -o demo

# The README's pictures of the jobs, of what the demo made.
pictures: .venv/ready demo
	$(BIN)/python examples/pictures/make_pictures.py demo

# The guide's pictures of the studio, which one of its tests takes; some minutes.
studio-pictures: .venv/ready
	LUTFORGE_SCREENSHOTS=$(CURDIR)/examples/pictures $(BIN)/python -m pytest -n 0 --basetemp $$(mktemp -d)/photographs \
	  tests/studio/test_page.py -k from_a_folder_of_shots

# The guide as a site that needs no network: site/index.html.
docs: .venv/ready
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet
	@echo "Open site/index.html."

# Minutes: everything that does not take long.
test: .venv/ready
	$(TESTS) -m "not slow"

# Everything, the long tests too, and the share of lines that they run, whose least is in pyproject.toml.
test-all: .venv/ready
	$(TESTS) --cov --cov-report=term

check: .venv/ready
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# Further versions of OpenColorIO, oiiotool and Blender, and a reader of CLF, for the tests, in the user's cache: 2.3 GB. Without them tests skip.
other-versions: .venv/ready
	$(BIN)/python -m tests.cases.other_versions

benchmark: .venv/ready
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[bench]'
	$(BIN)/python -m tests.benchmarks.speed
	$(BIN)/python -m tests.benchmarks.lattices

# Every figure that a change must keep; ACCURACY="--quick --compare FILE" for everyday use.
accuracy: .venv/ready
	$(BIN)/python -m tests.benchmarks.accuracy $(ACCURACY)

# 24 cameras whose truth is known, half to choose a change on and half to report on; FLEET="--half choose" for one half.
fleet: .venv/ready
	$(BIN)/python -m tests.benchmarks.fleet $(FLEET)

# LutForge beside other ways to a camera's look, in darktable and RawTherapee as installed; FIELD="--keep DIR" to go on.
field: .venv/ready
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[bench]'
	$(BIN)/python -m tests.benchmarks.field $(FIELD)

# Every figure that README and guide state, measured on this machine and written into them, in some hours; of an earlier
# run but for a part: FIGURES="--only speed".
figures: .venv/ready
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[bench]'
	$(BIN)/python -m tests.benchmarks.figures $(FIGURES)

# The programs that read our files, run as installed here, and the guide's table of what they do; -rs names those that
# are missing.
hosts: .venv/ready
	$(BIN)/python -m pytest -rs tests/luts/test_other_readers.py tests/luts/test_command_lines.py tests/luts/test_picture.py \
	  tests/grading/test_commands.py tests/kits/test_programs.py tests/ocio/test_versions.py tests/ocio/test_blender.py
	$(BIN)/python -m tests.cases.program_table

# What LutForge itself needs. Byte code is made of what is imported, when it is: of all, that would take most of the time.
.venv/installed: pyproject.toml constraints.txt
	@echo "Installing LutForge and the libraries that it needs into .venv: 650 MB, about a minute."
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt -e .
	touch $@

# And what the tests, the guide and the studio need.
.venv/ready: .venv/installed
	@echo "Installing what the tests need, too: 1.5 GB in all, two minutes."
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $@

clean:
	rm -rf .venv demo site
