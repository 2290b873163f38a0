"""What can go wrong in this room, and the one place where poses are checked.

SceneError        a scene cannot be had: unknown name, or a file that is missing, empty, without
                  triangles, open where a flight could leave it, or too large
PoseError         a place where nobody can be: not six numbers, not finite, or absurdly far away
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

FAR = 1e6  # m from the origin; float32 corners mean nothing there, and no arithmetic overflows


class SceneError(ValueError):
    """One line that says which scene, what is wrong, and what would be right."""


class PoseError(ValueError):
    """One line that says whose pose, which number is wrong, and what would be right."""


def checked_pose(
    pose: Sequence[float] | npt.NDArray[np.float64], whose: str
) -> npt.NDArray[np.float64]:
    """A pose as an array (6,): x, y, z [m, NED], roll, pitch, yaw [rad].

    Raises:
        PoseError: it is not six finite numbers, or lies farther than :data:`FAR` away.
    """
    try:
        place = np.asarray(pose, np.float64)
    except (TypeError, ValueError):
        raise PoseError(f"{whose} = {pose}: expected x, y, z, roll, pitch, yaw") from None
    if place.shape != (6,):
        raise PoseError(f"{whose} has shape {place.shape}: expected x, y, z, roll, pitch, yaw")
    for name, value in zip(("x", "y", "z", "roll", "pitch", "yaw"), place, strict=True):
        if not np.isfinite(value):
            raise PoseError(f"{whose}: {name} = {value}: expected a finite number")
    if np.abs(place[:3]).max() > FAR:
        x, y, z = place[:3]
        raise PoseError(f"{whose} = ({x:g}, {y:g}, {z:g}) m: expected at most {FAR:g} m away")
    return place
