# LPET. `make demo` and `make test` are all that a fresh clone needs.
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
export MUJOCO_GL ?= egl
export PYOPENGL_PLATFORM ?= $(MUJOCO_GL)
# The matrices are small: a second thread for each of two workers costs more than it gives.
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: demo test check bench experiments paper docs lock clean opengl env

env: $(STAMP)

$(STAMP): requirements.lock pyproject.toml tools/make_env.sh
	bash tools/make_env.sh $(PYTHON) $(VENV)
	@touch $@

opengl: $(STAMP)
	@bash tools/check_opengl.sh $(BIN)/python

demo: opengl
	$(BIN)/lpet demo --out out/demo

check: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

test: opengl check
	$(BIN)/pytest -q -n 2 --dist worksteal

bench: opengl
	$(BIN)/python -m benchmarks

experiments: opengl
	$(BIN)/python -m scenarios.grc1_fit --out docs/results
	$(BIN)/python -m scenarios.soil_slopes
	$(BIN)/python -m scenarios.rough_ground
	$(BIN)/python -m scenarios.experiments
	$(BIN)/python -m scenarios.hundred_metres
	$(BIN)/python -m scenarios.real_data
	$(BIN)/python -m scenarios.kitti_prediction
	$(BIN)/python -m scenarios.reach_checks
	$(BIN)/python -m scenarios.tradeoff_check
	$(BIN)/python -m scenarios.tradeoff_stability

paper: $(STAMP) ## the paper's experiment: hours; goes on where it was
	$(BIN)/python -m scenarios.paper_experiment
	$(BIN)/python -m scenarios.paper_bands

docs: $(STAMP) ## the site, in out/site
	$(BIN)/mkdocs build -q

lock: ## needs uv
	uv pip compile --python-version 3.11 --extra dev --no-header --no-emit-index-url --no-annotate --upgrade pyproject.toml -o requirements.lock

clean:
	rm -rf $(VENV) out build *.egg-info
