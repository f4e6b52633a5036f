"""`python -m jaxfric` is the command `jaxfric`."""

import sys

from .cli import main

sys.exit(main())
