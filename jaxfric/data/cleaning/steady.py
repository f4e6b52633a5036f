"""Stamps that scatter about a steady clock, rounded or written late, put on it."""

import numpy as np

from .pieces import spans, usual_step

# Stamps are averaged over so many samples each way for the clock that they scatter about: it
# follows any drift, and what is left of the scatter is an eighth.
NEAR_STAMPS = 32
# Levels of the stamps on either side of a lost row are known this much better than half a step,
# in standard deviations, which by chance happens to none of many million stamps.
CLEAR = 7.0
# A stamp that is rounded by 1 % of a step puts as much error on a derived velocity.
FINE = 0.01
# A line through rounded stamps is off by up to this part of the last digit at either end.
OFF = 0.125
# A stamp that is moved by a few samples is rounded to several. Beyond that a clock that stops and
# catches up between two stamps that differ, as one of a busy computer does, does not show.
FEW_STEPS = 3.0
# Late by less than a thousandth of a step changes a velocity by less than that: no repair.
NEGLIGIBLE = 0.001
# Stamps further out than a million normal ones ever are: perhaps the clock itself was late there.
FURTHEST = 6.0


def on_a_steady_clock(signals, segment: np.ndarray, notes: list[str]) -> np.ndarray:
    """The stamps, those of a steady clock put on it; shape `(N,)`, s."""
    time = signals["time"]
    parts, lines = spans(segment), list[tuple[slice, np.ndarray]]()
    for part in parts:
        if (line := _unrounded(time[part])) is not None:
            lines.append((part, line))
    if lines:
        moved = max(float(np.max(np.abs(time[part] - line))) for part, line in lines)
        time = time.copy()
        for part, line in lines:
            time[part] = line
        done = {part.start for part, _ in lines}
        parts = [part for part in parts if part.start not in done]
        usual = float(np.median(np.diff(time)))
        if moved > NEGLIGIBLE * usual:
            note = (
                "The time stamps are rounded, and agree to their last digit with a steady clock "
                f"of {1 / usual:.6g} Hz; that clock is used, which moves them by up to "
                f"{moved:.3g} s."
            )
            if moved > FEW_STEPS * usual:
                note = (
                    f"Warning: {note} That is {moved / usual:.0f} samples, between which nothing "
                    "shows whether the clock was steady: log the time with more digits."
                )
            notes.append(note)
    return _stamped_late(signals, time, segment, parts, notes)


# ---- rounded stamps ----


def _unrounded(time: np.ndarray) -> np.ndarray | None:
    """The steady clock that coarsely rounded stamps agree with to their last digit, or `None`.

    To move a stamp within its own rounding cannot do harm. A clock that drifts, or loses rows, is
    steady piece by piece.
    """
    step = np.diff(time)
    if len(time) < 2 * NEAR_STAMPS or step.min() < 0 or not step.any():
        return None
    error = 4 * np.spacing(max(abs(time[0]), abs(time[-1])))
    if np.ptp(step) <= error:
        return None
    digit = float(step[step > 0].min())
    if digit < FINE * float(np.mean(step)):
        return None
    # Of a clock whose rate is known no better than that each velocity is off by as much.
    if 2 * OFF * digit > FINE * float(np.ptp(time)):
        return None
    if np.max(np.abs(step - digit * np.rint(step / digit))) > error + 1e-6 * digit:
        return None
    ends = [0]
    while ends[-1] < len(time):
        stop = _reach(time, ends[-1], digit)
        if stop is None:
            return None
        ends.append(stop)
    pieces = zip(ends[:-1], ends[1:], strict=True)
    line = _joined([_straight(time[start:stop]) for start, stop in pieces])
    return line if np.all(np.diff(line) > 0) else None


def _joined(lines: list[np.ndarray]) -> np.ndarray:
    """Lines end to end, their ends brought together by half of what is between them.

    Where that is half a step or more rows are lost, and it stays.
    """
    bend = np.zeros((len(lines), 2))
    for i, (before, after) in enumerate(zip(lines[:-1], lines[1:], strict=True)):
        step = 0.5 * (before[-1] - before[-2] + after[1] - after[0])
        between = after[0] - before[-1] - step
        if abs(between) < 0.5 * step:
            bend[i, 1], bend[i + 1, 0] = 0.5 * between, -0.5 * between
    joined = []
    for line, (first, last) in zip(lines, bend, strict=True):
        along = np.linspace(-1.0, 1.0, len(line))
        joined.append(line + np.where(along < 0, -along * first, along * last))
    return np.concatenate(joined)


def _reach(time: np.ndarray, start: int, digit: float) -> int | None:
    """How far from `start` one straight line agrees with the stamps; `None` if not far enough."""

    def fits(stop):
        part = time[start:stop]
        return np.ptp(part - _straight(part)) <= (1 + 2 * OFF) * digit

    total = len(time)
    if fits(total):
        return total
    good, bad = min(start + 2 * NEAR_STAMPS, total), total
    if not fits(good):
        return None
    while 2 * good - start < total and fits(2 * good - start):
        good = 2 * good - start
    bad = min(2 * good - start, total)
    while bad - good > 1:
        middle = (good + bad) // 2
        good, bad = (middle, bad) if fits(middle) else (good, middle)
    # The rest must be long enough for a line of its own.
    return min(good, total - 2 * NEAR_STAMPS) if total - good < 2 * NEAR_STAMPS else good


def _straight(time: np.ndarray) -> np.ndarray:
    """The straight line through stamps over their number."""
    count = np.arange(len(time)) - 0.5 * (len(time) - 1)
    mean = np.mean(time)
    return mean + count * (count @ (time - mean) / (count @ count))


# ---- stamps that were written late ----


def _stamped_late(signals, time, segment, parts, notes) -> np.ndarray:
    """Put samples on the clock that their stamps scatter about, if the motion is smoother on it.

    A sample that was taken late is at v·δ beyond where it would have been, one that was only
    stamped late is not: the share of v·δ that the position holds is one or zero. Where it cannot
    be told, stamps that run back are no times of anything, and others are left alone.
    """
    name = next((role for role in ("position", "velocity") if role in signals), None)
    if name is None:  # a reference or a force to simulate by
        return time
    if all(_even(time[part]) for part in parts):
        return time
    late, steps = np.zeros(len(time)), usual_step(time, segment).copy()
    linked = np.zeros(len(time) - 1, bool)
    for part in parts:
        late[part], step, one = _scatter(time[part])
        if step > 0:
            steps[part] = step
        linked[part.start : part.stop - 1] = one
    if np.std(late / steps) < NEGLIGIBLE:
        return time
    share, error = _share(signals[name], late, steps, linked)
    lone = np.max(np.abs(late)) > FURTHEST * np.std(late)
    backward = np.any((np.diff(time) <= 0) & (np.diff(segment) == 0) & (late[1:] != late[:-1]))
    if abs(share) + 3 * error < 0.5:
        reason = f", on which the {name} is smoother"
    elif backward and not lone and not share - 3 * error > 0.5:
        reason = ", which some of them run back from"
    else:
        return time
    notes.append(
        f"The time stamps scatter by {np.std(late / steps):.1%} of a step about a steady "
        f"clock{reason}; that clock is used, which moves them by up to "
        f"{np.max(np.abs(late)):.3g} s."
    )
    return time - late


def _even(time: np.ndarray) -> bool:
    """Whether steps are so alike that stamps cannot scatter about their mean over a window by what
    counts.
    """
    step = np.diff(time)
    return bool(len(step)) and np.ptp(step) <= NEGLIGIBLE / (2 * NEAR_STAMPS) * np.min(step)


def _share(signal, late, steps, linked) -> tuple[float, float]:
    """The share of v·δ that a signal holds, and its standard error (infinite if unknown)."""
    # Third differences leave nothing of the motion itself.
    whole = linked[:-2] & linked[1:-1] & linked[2:]
    signal = np.where(np.isfinite(signal), signal, np.nan)
    beyond = np.gradient(signal) * late / steps
    ours, theirs = np.diff(signal, 3), np.diff(beyond, 3)
    whole &= np.isfinite(ours) & np.isfinite(theirs)
    if np.count_nonzero(whole) < 2 * NEAR_STAMPS:
        return 0.0, np.inf
    # What neither share explains, a seam or a glitch, is not the clock's.
    strange = np.minimum(np.abs(ours), np.abs(ours - theirs))
    limit = 20 * float(np.median(strange[whole]))
    if limit > 0:
        whole &= strange <= limit
    ours, theirs = ours[whole], theirs[whole]
    power = float(theirs @ theirs)
    if not power > 0:
        return 0.0, np.inf
    share = float(theirs @ ours) / power
    # Neighbouring differences share samples: twice the error of independent ones.
    return share, 2 * float(np.sqrt(np.mean((ours - share * theirs) ** 2) / power))


def _scatter(time: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """By how much each stamp is late beside a clock that only drifts, that clock's step, s, and
    which samples follow each other on it. Zeros where there is no such clock.
    """
    none = np.zeros(len(time)), 0.0, np.ones(len(time) - 1, bool)
    if len(time) < 2 * NEAR_STAMPS:
        return none
    step = float(np.median(np.diff(time)))
    if step > 0:
        apart = np.rint(np.diff(time) / step)
        if apart.min() >= 1:  # else several stamps lie within a step
            late, slope = _beside(time, np.concatenate([[0], np.cumsum(apart)]))
            if np.max(np.abs(late)) < 0.5 * slope:
                return late, slope, apart == 1
    ticks = _counted(time)
    if ticks is None:
        return none
    late, step = _beside(time, ticks)
    return late, step, np.diff(ticks) == 1


def _beside(time: np.ndarray, ticks: np.ndarray) -> tuple[np.ndarray, float]:
    """What is left of the stamps beside a straight line, or beside one that drifts if it does."""
    slope, start = np.polyfit(ticks, time, 1)
    late = time - (start + slope * ticks)
    window = np.ones(min(2 * NEAR_STAMPS + 1, len(time)))
    mean = np.convolve(late, window, "same") / np.convolve(np.ones(len(late)), window, "same")
    # Means of that many independent stamps scatter by this much without any drift.
    still = np.std(late - mean) / np.sqrt(len(window))
    return (late if np.std(mean) < 2 * still else late - mean), float(slope)


def _counted(time: np.ndarray) -> np.ndarray | None:
    """Ticks of a steady clock by the number of the row, however wide the stamps scatter about it.

    `None` where intervals, not stamps, scatter: then second differences over longer stretches grow
    as the root of their length, while those of stamps about a clock stay the same.
    """
    long = min(64, len(time) // 4)
    step = float(np.median(time[long:] - time[:-long])) / long
    if not step > 0:
        return None
    rest = time - step * np.arange(len(time))
    near, far = _wander(rest, 4), _wander(rest, long)
    if near < FINE * step or far > near * np.sqrt(np.sqrt(long / 4)):
        return None
    # The second difference of independent stamps has six times their variance; the median of its
    # size is 0.6745 standard deviations.
    deviation = near / (0.6745 * np.sqrt(6) * step)
    side = int(np.clip(2 * (2 * CLEAR * deviation) ** 2, NEAR_STAMPS, len(time) // 2))
    shift = _shifts(rest, side) / step
    if shift.min() < -0.5:  # rows are there twice: not every row is a tick
        return None
    above = shift > 0.5
    lost = np.zeros(len(time))
    places = np.flatnonzero(above)
    for part in np.split(places, np.flatnonzero(np.diff(places) > 1) + 1):
        if len(part):
            at = part[np.argmax(shift[part])]
            lost[at] = np.rint(shift[at])
    return np.arange(len(time)) + np.cumsum(lost)


def _wander(rest: np.ndarray, lag: int) -> float:
    """The median of second differences over a lag: a few lost rows do not show in it."""
    return float(np.median(np.abs(rest[2 * lag :] - 2 * rest[lag:-lag] + rest[: -2 * lag])))


def _shifts(rest: np.ndarray, side: int) -> np.ndarray:
    """By how much the level rises between the `side` stamps before and those from each on."""
    total = np.concatenate([[0.0], np.cumsum(rest - rest[0])])
    mean = (total[side:] - total[:-side]) / side
    shift = np.zeros(len(rest))
    shift[side : len(rest) - side + 1] = mean[side:] - mean[:-side]
    return shift
