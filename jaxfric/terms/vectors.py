"""Parameters of terms as vectors, of jax or, where nothing is to be compiled, of numpy."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


def vector(values) -> Float[Array, " k"]:
    """Numbers as one vector; a batch of each as a batch of vectors."""
    if values and all(isinstance(v, np.ndarray | np.generic) for v in values):
        return np.stack(values, axis=-1)
    return jnp.stack([jnp.asarray(v) for v in values], axis=-1) if values else _nothing()


def _nothing() -> np.ndarray:
    """No number, in jax's default precision; of numpy, so that nothing is compiled."""
    return np.zeros((0,), jax.dtypes.canonicalize_dtype(float))


def joined(vectors) -> Float[Array, " k"]:
    """Vectors as one; batches of each as a batch."""
    full = [each for each in vectors if each.shape[-1]]
    if full and all(isinstance(each, np.ndarray) for each in full):
        return np.concatenate(full, axis=-1)  # of what was moved to numpy nothing is compiled
    return jnp.concatenate(full, axis=-1) if full else _nothing()


def split(vector, counts):
    """A vector in parts of so many numbers each."""
    ends = [sum(counts[: i + 1]) for i in range(len(counts))]
    return [vector[end - count : end] for end, count in zip(ends, counts, strict=True)]
