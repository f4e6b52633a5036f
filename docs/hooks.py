"""What mkdocs does before it reads the pages."""

import sys
from pathlib import Path


def on_startup(**_) -> None:
    """Let the pages import what lies beside them: `from showing import picture`."""
    sys.path.insert(0, str(Path(__file__).parent))
