"""What rviz shows of navigation: the footprint along the plan, and the candidates with their clearances."""
import numpy as np

from wheelchair_shared_control import footprint as footprints

EVERY = 0.25  # m, and radians: between two footprints
CLOSE, WIDE = 0.03, 0.30  # m: clearances drawn red and green


def footprints_along(footprint, poses):
    """End points (n, 2) of lines, two by two: outlines of the footprint along ``poses`` (m, 3)."""
    lines, last = [np.empty((0, 2))], None
    for k, pose in enumerate(poses):
        far = last is None or np.abs(pose - last).max() >= EVERY
        if not far and k + 1 < len(poses):
            continue
        last = pose
        corners = footprints.corners(footprint, pose)
        lines.append(np.stack((corners, np.roll(corners, -1, axis=0)), axis=1).reshape(-1, 2))
    return np.concatenate(lines)


def candidates(looked_at):
    """[(poses (n, 3), text, colour rgba)] of navigation.Candidates: green where there is room, red where not."""
    result = []
    for poses, command, clearance in zip(*looked_at):
        share = float(np.clip((clearance - CLOSE) / (WIDE - CLOSE), 0.0, 1.0))
        text = "%.2f m/s %.2f rad/s: %.2f m" % (command[0], command[1], clearance)
        result.append((poses, text, (1.0 - share, share, 0.1, 0.9)))
    return result
