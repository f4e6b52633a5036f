import jax
import pytest


@pytest.fixture(autouse=True, scope="session")
def float64():
    """Benchmarks are of the numbers users get: double precision, as the command line has it."""
    jax.config.update("jax_enable_x64", True)
