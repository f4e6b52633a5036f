"""Strict settings for every test: double precision, no implicit promotion, no chance."""

import os
from pathlib import Path

# One worker a core: more threads for small matrices would only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import jax
import pytest
from hypothesis import settings

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")

# Compiling takes longer than any deadline, and a test that fails must fail again when it is rerun.
settings.register_profile("jaxfric", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("jaxfric")


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The folder with real recordings, from JAXFRIC_DATA or `../shared/data` beside the project."""
    beside = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("JAXFRIC_DATA", beside))
    if not folder.is_dir():
        pytest.skip("no folder with real recordings: set JAXFRIC_DATA to one")
    return folder
