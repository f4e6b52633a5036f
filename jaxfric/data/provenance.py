"""What a result was made from and by: the input's hash, and the versions of the libraries."""

import hashlib
import os
from functools import cache
from importlib.metadata import PackageNotFoundError, version

# Whose arithmetic the figures are.
LIBRARIES = ("jaxfric", "jax", "jaxlib", "numpy")


@cache
def versions() -> dict[str, str]:
    """The versions of the libraries whose arithmetic a result is, by name."""
    return {name: _version(name) for name in LIBRARIES}


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"


def sha256(path: str | os.PathLike) -> str:
    """The SHA-256 of a file's bytes, as `sha256sum` prints it; empty for what is no file."""
    if not os.path.isfile(path):
        return ""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
