"""The command `jaxfric`: the only place that parses arguments, prints, and switches on float64.

Nothing heavy is imported before a command runs, so that `jaxfric --help` answers at once.
"""

import gc
import os
import shlex
import sys
import warnings
from collections.abc import Sequence
from io import TextIOWrapper

from .arguments import whole
from .messages import message
from .options import check_outputs


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit status: 0 done, 2 bad input or usage."""
    given = sys.argv[1:] if argv is None else list(argv)
    arguments = whole().parse_args(given)
    arguments.typed = shlex.join(["jaxfric", *given])
    name = f"jaxfric {arguments.command}"
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # what its encoding lacks is no reason to fail
            stream.reconfigure(errors="backslashreplace")
    try:
        check_outputs(arguments)
        gc.disable()  # importing makes much and throws nothing away: a tenth of its time
        _configure()
        status = arguments.run(arguments)
        sys.stdout.flush()
        return status
    except BrokenPipeError:  # the reader, `head` for one, has seen enough
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - Python flushes it at exit
        return 0
    except (ValueError, OSError) as error:
        print(f"{name}: {message(error)}", file=sys.stderr)
        return 2
    except MemoryError:
        print(f"{name}: out of memory; split the file or identify fewer samples.", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"{name}: interrupted", file=sys.stderr)
        return 130


def _configure() -> None:
    """float64, quick loops, and jax's cache of compiled programs in the user's cache folder."""
    # Explaining multiplies many small matrices, where several threads wait more than they work.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    import jax

    from ..programs import use_cache, use_quick_loops

    jax.config.update("jax_enable_x64", True)
    use_quick_loops()
    use_cache()
    # A folder that cannot be written, an entry of a process that was killed: the program is
    # compiled anew, and the user need not hear of it.
    warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache")
