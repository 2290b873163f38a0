"""Indoor worlds as the viewer and the film of a flight draw them."""

import numpy as np
import pytest

from deploy.viewer.meshes import OpenMesh
from sim.indoor.content.scene import load

SCENE = "indoor-long"


def test_a_room_is_drawn_without_its_ceiling_in_its_own_colours() -> None:
    scene = load(SCENE, lit=False)
    mesh = OpenMesh.of(scene.mesh)
    assert len(mesh.corners) == len(mesh.paint) > 500
    assert mesh.corners[..., 2].max() == pytest.approx(0.0, abs=0.05)  # the floor
    flat = np.ptp(mesh.corners[..., 2], axis=1) < 1e-3
    assert mesh.corners[flat][..., 2].min() > 0.3 - scene.height
    assert 20 < mesh.paint.mean() < 235
