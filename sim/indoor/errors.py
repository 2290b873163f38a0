"""What can go wrong in this room.

SceneError        a scene cannot be had: unknown name, or a file that is missing, empty, without
                  triangles, open where a flight would start, or too large
"""


class SceneError(ValueError):
    """One line that says which scene, what is wrong, and what would be right."""
