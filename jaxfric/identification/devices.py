"""Rows of a batch over all devices: those of this process, or of every process of a cluster.

Rows do not need each other, so every device works through its share by itself (`jax.shard_map`)
and nothing is exchanged. jax's settings are left alone: on a CPU the program that wants a device a
core says so before it uses jax (`jax.config.update("jax_num_cpu_devices", 2)`), and several
processes are joined by `jax.distributed.initialize`.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from ..checks import Design
from ..data.recording import Recording
from ..models import Model
from ..terms.base import AbstractTerm
from .checking import checked, looked_at
from .identified import Identified, raise_unless_successful
from .projections import AbstractProjection
from .setup import Setup, ready_rows, set_up, together
from .solving import solve_rows

AXIS = "rows"


def mesh(devices: Sequence[jax.Device] | None = None) -> Mesh:
    """A line of devices for [`identify`][]: by default all, of all processes."""
    return Mesh(np.asarray(jax.devices() if devices is None else devices, object), (AXIS,))


def identify(
    model: AbstractTerm | Model | Identified | str,
    recordings: Recording,
    *,
    over: Mesh | None = None,
    projection: AbstractProjection | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    grid: int | None = None,
    throw: bool = False,
) -> Identified:
    """[`jaxfric.identify`][] of a batch, its rows spread over devices.

    **Arguments:** `recordings`, made by `stack`, signals of shape `(B, N)`; with several processes
    the rows of this one: every process calls with as many rows, of the same length, and the same
    other arguments, among them the projection. `over`, from [`mesh`][jaxfric.devices.mesh]; the
    others as there. The rows share one kernel, of the median width, and one projection.

    **Returns:** what was identified of the rows given, arrays of numpy with a leading axis `B`.

    **Raises:** `ValueError` as `jaxfric.identify`, or if `recordings` is no batch.
    """
    if recordings.time.ndim != 2:
        raise ValueError(
            "devices.identify() spreads a batch; of one recording make one by "
            "jaxfric.stack([recording]), or use jaxfric.identify()."
        )
    rows = ready_rows(recordings)
    prepared = together(recordings, rows)
    setup = set_up(model, recordings, projection, bounds, grid, prepared=prepared)
    found = solve(setup, looked_at(recordings, rows).result, over)
    if throw:
        raise_unless_successful(found)
    return found


def solve(setup: Setup, faults: Callable[[], np.ndarray], over: Mesh | None = None) -> Identified:
    """The identification of a batch, each device at its own rows; arrays of numpy.

    `faults` gives those of the recordings, `(B, W)`, and is asked last: as [`looked_at`][] does.
    """
    over = mesh() if over is None else over
    count = setup.recording.time.shape[0]
    own = sum(device.process_index == jax.process_index() for device in over.devices.flat)
    if over.size == 1:
        found, design = solve_rows(*setup)
    else:
        # Each device has as many rows; what is missing is filled up with the last one.
        full = -(-count // own) * own
        batch = jax.tree.map(lambda x: _spread(x, full, over), setup.recording)
        spread = _solve(setup._replace(recording=batch), over)
        found, design = jax.tree.map(lambda x: _gather(x)[:count], spread)
    found = checked(found, design, setup.recording, faults())
    return jax.tree.map(np.asarray, found)


@eqx.filter_jit
def _solve(setup: Setup, over: Mesh) -> tuple[Identified, Design]:
    def share(recording):
        return solve_rows(*setup._replace(recording=recording))

    rows = PartitionSpec(AXIS)
    return jax.shard_map(share, mesh=over, in_specs=rows, out_specs=rows, check_vma=False)(
        setup.recording
    )


def _spread(rows: Any, full: int, over: Mesh) -> jax.Array:
    local = np.asarray(rows)
    local = np.concatenate([local, np.repeat(local[-1:], full - len(local), axis=0)])
    return jax.make_array_from_process_local_data(NamedSharding(over, PartitionSpec(AXIS)), local)


def _gather(rows: jax.Array) -> np.ndarray:
    """The rows that this process holds, in order."""
    shards = sorted(rows.addressable_shards, key=lambda shard: shard.index[0].start or 0)
    return np.concatenate([np.asarray(shard.data) for shard in shards])
