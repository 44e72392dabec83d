"""What rviz shows of the doorways: jambs, lintel, an arrow through, a label with width and confidence."""
from typing import NamedTuple, Tuple

import numpy as np

ARROW, CUBE, TEXT = 0, 1, 9  # visualization_msgs/Marker types
FRAME_WIDTH = 0.06  # m
JAMB, WAY = (0.10, 0.65, 0.30, 0.9), (0.10, 0.65, 0.30, 0.7)
LABEL = (0.05, 0.05, 0.1, 1.0)  # dark: floor, walls and background are light


class Shape(NamedTuple):
    """One marker in the doorway's frame: ``position`` (3,), ``yaw``, ``scale`` (3,), ``colour`` (4,)."""

    name: str
    kind: int
    position: Tuple[float, float, float]
    yaw: float
    scale: Tuple[float, float, float]
    colour: Tuple[float, float, float, float]
    text: str = ""


def shapes(doorway, height):
    """Shapes (tuple) of one ``Doorway`` whose lintel is taken to be at ``height`` [m]."""
    x, y, yaw = (float(value) for value in doorway.pose)
    colour = JAMB[:3] + (0.35 + 0.6 * float(np.clip(doorway.confidence, 0.0, 1.0)),)
    # jambs stand beside the gap, so that what is drawn leaves the clear width clear
    outward = (doorway.jambs - doorway.pose[:2]) / max(doorway.width / 2.0, 1e-6)
    middles = doorway.jambs + outward * FRAME_WIDTH / 2.0
    result = [
        Shape(name, CUBE, (float(at[0]), float(at[1]), height / 2.0), yaw, (0.14, FRAME_WIDTH, height), colour)
        for name, at in zip(("left", "right"), middles)
    ]
    result.append(Shape("lintel", CUBE, (x, y, height + FRAME_WIDTH / 2.0), yaw,
                        (0.14, doorway.width + 2.0 * FRAME_WIDTH, FRAME_WIDTH), colour))
    back = 0.5
    start = (x - back * float(np.cos(yaw)), y - back * float(np.sin(yaw)), 0.05)
    result.append(Shape("way", ARROW, start, yaw, (1.5, 0.06, 0.06), WAY))
    text = "%.2f m, %.0f %%" % (doorway.width, 100.0 * doorway.confidence)
    result.append(Shape("label", TEXT, (x, y, height + 0.25), 0.0, (0.0, 0.0, 0.2), LABEL, text))
    return tuple(result)
