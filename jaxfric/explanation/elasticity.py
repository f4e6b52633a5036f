"""Whether the transmission of a robot's joint gives, by the forces of all its joints.

An encoder on the motor does not see how far the link is behind it. All joints feel the link's
motion by the mass matrix: what no value of a rigid model can imitate. So the spring competes with
all values of the simulator at once, each free, at each joint that the log has.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np

from ..data.printable import listed_and
from ..identification.uncertainty import Estimate
from ..simulators import elastic
from . import parameters as spelled
from .acceptance import HALF, LEAST_SHARE, LINEARITY
from .agreement import Told
from .elastic_rows import robot_rows
from .evidence import gather
from .fewest import SURE
from .figures import cast
from .joint_rows import joint_rows
from .motion import motion_of
from .problem import PERSISTS
from .quantities import quantity
from .spring_trial import DAMPING, STIFFNESS, Recorded, Trial

# A spring's force is a second derivative of a force. The noise of the acceleration is 2⁵ to 2⁷
# times weaker through a kernel of twice the usual width, the motion that bends the spring hardly.
WIDE = 2
DOUBT = "a spring there would explain as much, and this motion does not tell its stiffness"


class ElasticJoint(NamedTuple):
    """A spring in the transmission of a joint.

    `estimates` of its stiffness, N·m/rad or N/m, and its damping; `share`: the part that it has of
    what no value of the simulator explains; `held`: the same on the held-out recording, `None`
    without one; `felt`: the joints whose force it changes.
    """

    joint: str
    estimates: Mapping[str, Estimate]
    share: float
    held: float | None
    felt: frozenset[str]

    def unwritable(self, why: str) -> "Suspicion":
        """What it says where the simulator's file does not take it."""
        return self._doubted(f"cannot be put into the file: {why}")

    def rivalled(self) -> "Suspicion":
        """What it says where values of the simulator explain as much with as few numbers."""
        return self._doubted("explains as much as what is named here")

    @property
    def alone(self) -> bool:
        """Whether another spring could not take beside it what any has to take."""
        return 1 - self.share < LEAST_SHARE

    def stands_beside(self, other: "ElasticJoint | Suspicion") -> bool:
        """Whether a spring that was found beside this one takes less than any spring has to take,
        of what no value explains without either.
        """
        return (1 - self.share) * other.share < LEAST_SHARE

    def among(self, other: "ElasticJoint | Suspicion") -> "Suspicion":
        """What it says where another transmission gives, too: one of two springs alone has another
        stiffness.
        """
        several = listed_and([self.joint, other.joint])
        text = quantity(self.estimates[STIFFNESS], smaller=False)
        why = (
            f"a spring of {text} in joint {self.joint} explains {self.share:.0%} of what no value "
            f"does, and beside it one in joint {other.joint} still more, so that neither stiffness "
            "is told"
        )
        both = 1 - (1 - self.share) * (1 - other.share)
        return Suspicion(several, why, both, self.felt | other.felt)

    def _doubted(self, why: str) -> "Suspicion":
        text = quantity(self.estimates[STIFFNESS], smaller=False)
        return Suspicion(self.joint, f"a spring of {text} {why}", self.share, self.felt)


class Suspicion(NamedTuple):
    """A joint whose transmission may give, though no spring of it is sure, with `why`; the `share`
    of a spring there, as above, and the joints whose force it would change.
    """

    joint: str
    why: str
    share: float
    felt: frozenset[str]


def elastic_joint(
    told: Sequence[Told], source: str, folder: Path | None, only: str = ""
) -> ElasticJoint | Suspicion | None:
    """The spring that the robot's forces tell of; `None` where they tell of none.

    **Arguments:** `source`: the model's text, in which it is tried; `folder`, of its meshes; `only`
    the joint to ask, where it is known.

    **Raises:** `ValueError` where the text does not take a spring.
    """
    with jax.enable_x64(True):
        width = max(_width(each) for each in told)
        try:
            here = _recorded(told, 0, width)
        except ValueError:  # too short for so wide a kernel
            return None
        tried = [Trial(told, source, folder, name) for name in ([only] if only else _joints(told))]
        if not tried or not _felt(here, np.zeros_like(here.rows.target)):
            return None  # the values leave no more than a sensor resolves
        coarse = [trial.coarse(here) for trial in tried]
        best = min(range(len(tried)), key=lambda i: coarse[i][0])
        other = _other(told, width)
        return _spring(tried[best], coarse[best][1], here, other)


def _width(each: Told) -> int:
    return gather(motion_of(cast(each.simulator.beside(each.logs[0])))).width


def _recorded(told: Sequence[Told], number: int, width: int, wide: int = WIDE) -> Recorded:
    joints = []
    for each in told:
        log, model = each.logs[number], each.simulator.baseline(each.logs[number].units)
        delay = each.explanation.fit["filtered_force_error"]["force_taken_later"]
        joints.append(joint_rows(each.simulator, log, model, delay, LINEARITY, wide, width))
    return Recorded(number, robot_rows(joints), wide * width)


def _other(told: Sequence[Told], width: int) -> Recorded | None:
    """What has to confirm a spring: the held-out recording, or else a kernel as wide again."""
    try:
        if all(len(each.logs) > 1 for each in told):
            return _recorded(told, 1, width)
        return _recorded(told, 0, width, 2 * WIDE)
    except ValueError:  # too short for such a kernel
        return None


def _joints(told: Sequence[Told]) -> list[str]:
    """The joints whose force was recorded, without those that have a spring already."""
    first = told[0].simulator
    motors = [first.joints[i] for i in elastic.springs_of(first.mujoco, first.model).values()]
    return [each.simulator.joint for each in told if each.simulator.joint not in motors]


def _spring(
    trial: Trial, start: np.ndarray, here: Recorded, other: Recorded | None
) -> ElasticJoint | Suspicion | None:
    """The spring near a place, where it is beyond noise and another recording or kernel bears it
    out.
    """
    box = trial.nodes(here)[1]
    found = trial.fitted(here, start, box)
    share = 1 - found.energy / float(here.least @ here.least)
    felt = _felt(here, found.left[: len(here.rows.target)])
    if share < LEAST_SHARE or not felt:
        return None
    doubt = Suspicion(trial.joint, DOUBT, share, felt) if share >= HALF else None
    if other is None:
        return doubt
    there = trial.fitted(other, found.place, box)
    held = 1 - trial.left(other, found.place, box) / float(other.least @ other.least)
    ours, theirs = (trial.estimates(f, r, box) for f, r in ((found, here), (there, other)))
    joined = spelled.with_elsewhere if other.number else spelled.with_smoothing
    known = joined(ours, theirs)
    if held < PERSISTS * share or not _sure(known[STIFFNESS]):
        return doubt
    # A motion below the resonance sees the damping as the smoothing of its acceleration does.
    unseen = known[DAMPING]._replace(standard_error=np.float64(np.inf))
    known = known | {DAMPING: unseen}
    return ElasticJoint(trial.joint, known, share, held if other.number else None, felt)


def _sure(stiffness: Estimate) -> bool:
    return float(stiffness.value) > SURE * float(stiffness.standard_error)


def _felt(here: Recorded, left: np.ndarray) -> frozenset[str]:
    """The joints of whose force a spring that leaves so much takes what a sensor resolves."""
    number, weight = here.rows.kernel.number, here.rows.kernel.weight
    gains = np.bincount(number, here.least**2 - left**2)
    names = set()
    for k, (rows, gain) in enumerate(zip(here.rows.joints, gains, strict=True)):
        assert rows.evidence is not None  # the rows are of a recording
        force = rows.evidence.force * weight[np.argmax(number == k)]
        if gain > LINEARITY**2 * float(force @ force):
            names.add(rows.name)
    return frozenset(names)
