import jax
import pytest

from jaxfric import programs


def pytest_configure(config):
    """Loops are compiled as the command does, if none was yet."""
    programs.use_quick_loops()


@pytest.fixture(autouse=True, scope="session")
def float64():
    """Benchmarks are of the numbers users get: double precision, as the command line has it."""
    jax.config.update("jax_enable_x64", True)
