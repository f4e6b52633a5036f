"""Pictures on the pages that run: `print(picture(axes))` in a block shows what `plot` returned."""

import base64
import io

import matplotlib

matplotlib.use("agg")


def picture(axes) -> str:
    """The figure of one or several axes as an image in Markdown; a page's own `print` shows it."""
    figure = getattr(axes, "figure", None) or axes[0].figure
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110, bbox_inches="tight")
    return f"![](data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()})"
