"""MuJoCo and its models (MJCF, URDF): read, or refused with the reason."""

from pathlib import Path
from typing import Any


def library() -> Any:
    """The package `mujoco`, or a message that says what to install."""
    try:
        import mujoco
    except ImportError as error:
        raise ValueError(
            "MuJoCo is not installed, which a MuJoCo or URDF model needs. Install it: "
            'pip install "jaxfric[mujoco]".'
        ) from error
    return mujoco


def is_text(model: str | Path) -> bool:
    """Whether this is a model's text and no file's name."""
    return str(model).lstrip().startswith("<")


def read(mujoco: Any, model: str | Path, folder: Path | None = None) -> Any:
    """The compiled model of a file or of its text; `folder`, in which a text's meshes lie."""
    text = str(model)
    try:
        if is_text(model) and folder is not None:
            spec = mujoco.MjSpec.from_string(text)
            spec.modelfiledir = str(folder)
            return spec.compile()
        if is_text(model):
            return mujoco.MjModel.from_xml_string(text)
        if not Path(text).is_file():
            raise ValueError(f"{text}: there is no such file.")
        return mujoco.MjModel.from_xml_path(text)
    except ValueError as error:
        name = "The model" if is_text(model) else text
        message = " ".join(str(error).split())
        raise ValueError(
            message if "no such file" in message else f"{name}: MuJoCo cannot read it: {message}"
        ) from error


def joints_of(mujoco: Any, model: Any) -> list[str]:
    """The joints' names in the order of the generalised coordinates.

    **Raises:** `ValueError` for a model without joints, with free or ball joints, or with loops.
    """
    names = [model.joint(i).name or f"joint{i + 1}" for i in range(model.njnt)]
    single = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
    if wrong := [n for n, k in zip(names, model.jnt_type, strict=True) if int(k) not in single]:
        raise ValueError(
            f"The model's joint {wrong[0]} is free or a ball, whose position a log of an axis does "
            "not hold. Fix it in the model."
        )
    if model.neq:
        raise ValueError(
            "The model closes loops by equality constraints, whose forces no log tells. Open them."
        )
    if not names:
        raise ValueError("The model has no joint.")
    return names


def is_hinge(mujoco: Any, model: Any, joint: int) -> bool:
    """Whether a joint turns; else it slides."""
    return int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_HINGE)
