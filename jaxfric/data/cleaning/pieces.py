"""Pieces of a record, and sentences that count samples."""

import numpy as np

# A step of the clock this many times the usual one, either way, is an interruption: jitter and a
# lost sample or two stay below it, and across it no derivative of the position means anything.
GAP = 5.0


def runs(labels: np.ndarray) -> np.ndarray:
    """0, 1, … for each run of equal labels, in the order of the record."""
    # An empty cell next to an empty cell is no change: NaN differs from itself.
    same = labels[1:] == labels[:-1]
    if labels.dtype.kind == "f":
        same |= np.isnan(labels[1:]) & np.isnan(labels[:-1])
    numbered = np.zeros(len(labels), np.int32)
    np.cumsum(~same.astype(bool), dtype=np.int32, out=numbered[1:])
    return numbered


def begun(segment: np.ndarray, begins: np.ndarray) -> np.ndarray:
    """The segments, further ones begun at some samples."""
    return runs(segment + np.cumsum(begins)) if begins.any() else segment


def some(values: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """The chosen values; themselves where all are, since of a long record each copy counts."""
    return values if chosen.all() else values[chosen]


def borders(segment: np.ndarray) -> np.ndarray:
    """Where a segment begins, but for the first."""
    return np.flatnonzero(np.diff(segment)) + 1


def spans(segment: np.ndarray) -> list[slice]:
    """The samples of each segment."""
    ends = [0, *borders(segment).tolist(), len(segment)]
    return [slice(*pair) for pair in zip(ends[:-1], ends[1:], strict=True)]


def usual_step(time: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Median forward step of each sample's segment: segments may have rates of their own."""
    step = np.diff(time)
    forward = (np.diff(segment) == 0) & (step > 0)
    if not forward.any():
        return np.full(len(time), np.nan)
    if segment[-1] == 0:
        median = np.median(some(step, forward), overwrite_input=True)
        return np.broadcast_to(median, len(time))
    usual = np.full(int(segment[-1]) + 1, np.median(step[forward]))
    label, step = segment[1:][forward], step[forward]
    parts = np.flatnonzero(np.diff(label)) + 1
    for part, name in zip(np.split(step, parts), label[np.r_[0, parts]], strict=True):
        usual[name] = np.median(part)
    return usual[segment]


def adjacent(time: np.ndarray, mask: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Whether sample i and i + 1 are both valid, of one segment, and no sample is lost between.

    Two samples without one between them are less than one and a half usual steps apart.
    """
    near = np.diff(time) < 1.5 * usual_step(time, segment)[1:]
    return near & mask[1:] & mask[:-1] & (np.diff(segment) == 0)


def plural(count: int, noun: str = "sample") -> str:
    """`1 sample`, `2 samples`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def note(notes: list[str], chosen: np.ndarray, rows: np.ndarray, what: str) -> None:
    """Add a sentence on the chosen samples, if there are any."""
    count = int(np.count_nonzero(chosen))
    if count:
        notes.append(f"{plural(count)} {what} (first at row {rows[np.argmax(chosen)]}).")
