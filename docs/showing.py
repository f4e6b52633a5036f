"""Pictures on the pages that run: `show(axes)` in a block draws what `plot` returned below it."""

import base64
import io

import matplotlib

matplotlib.use("agg")


def show(axes) -> None:
    """Print the figure of one or several axes as an image in Markdown."""
    figure = getattr(axes, "figure", None) or axes[0].figure
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110, bbox_inches="tight")
    print(f"![](data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()})")
