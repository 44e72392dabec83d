"""The detector's errors over many random scenes: recall, precision, errors of place, direction and width."""
from typing import NamedTuple, Tuple

import numpy as np

from wheelchair_shared_control import camera as cameras
from wheelchair_shared_control import doorway, se2
from wheelchair_shared_control.doorway_tracker import DoorwayTracker, in_frame
from wheelchair_shared_control.experiments import detector_scenes
from wheelchair_shared_control.simulation import depth_noise, zbuffer

MATCH_DISTANCE = 0.3  # m
MATCH_ANGLE = np.radians(15.0)
MAX_DRAWS = 3000
OPEN_SHARE = 2.0 / 3.0  # of the scenes hold an open doorway


class Match(NamedTuple):
    """A doorway found: ``expected`` Opening or None, ``found`` Doorway in the world or None."""

    expected: object
    found: object


class Result(NamedTuple):
    """One scene: what is asked for and what was found. ``required``: its first opening must be found; ``error``
    (4,) of it: across, along [m], turn [rad], width [m], NaN if missed; ``false`` are doorways that match no
    opening."""

    seed: int
    scene: detector_scenes.DetectorScene
    required: bool
    found: bool
    error: np.ndarray
    false: Tuple
    matched: int
    detection: object
    image: np.ndarray


class Studio:
    """The chair's camera in a drawn scene, with the simulator's noise."""

    def __init__(self, simulator_settings, detector_settings):
        self.detector_settings = detector_settings
        self.noise_settings = simulator_settings.depth_noise
        self.wheelchair = simulator_settings.wheelchair
        self.camera = cameras.from_settings(self.wheelchair)
        self.base_from_camera = cameras.mounting(self.wheelchair)

    def look(self, boxes, base, rng):
        """Noisy depth image and true depth, both (height, width) [m], of ``boxes`` from ``base`` (3,)."""
        world_from_camera = cameras.lifted(base) @ self.base_from_camera
        inverse, plane = zbuffer.render(boxes, self.camera, world_from_camera, 12.0)
        with np.errstate(divide="ignore"):
            truth = np.float32(1.0) / inverse
        noise = depth_noise.DepthNoise(self.noise_settings, self.wheelchair, rng)
        return noise.apply(inverse, plane, self.camera), truth

    def sees_jambs(self, opening, base, truth):
        """Is the wall beside both jambs, at most 0.10 m from them, in view and not hidden?"""
        world_from_camera = cameras.lifted(base) @ self.base_from_camera
        camera_from_world = np.linalg.inv(world_from_camera)
        for beside in (0.02, 0.05, 0.09):
            for point in detector_scenes.beside_jambs(opening, beside):
                heights = np.linspace(0.2, 1.4, 25)
                points = np.column_stack((np.tile(point, (25, 1)), heights, np.ones(25)))
                x, y, z, _ = camera_from_world @ points.T
                u = np.rint(self.camera.fx * x / z + self.camera.cx).astype(int)
                v = np.rint(self.camera.fy * y / z + self.camera.cy).astype(int)
                inside = (z > self.wheelchair.camera.min_range) & (u >= 0) & (u < self.camera.width) & (v >= 0) & (
                    v < self.camera.height)
                seen = np.abs(truth[v[inside], u[inside]] - z[inside]) < 0.02
                if seen.sum() < 8 or (seen & (heights[inside] > 0.7)).sum() < 5:
                    return False
        return True


def draw(studio, seed):
    """A scene (DetectorScene), its noisy image, and whether its first opening must be found; drawn by ``seed``.

    A third of the scenes holds no open doorway. In the others both jambs, and 0.10 m of wall beside each, are in
    view and not hidden, except where a leaf folded into the room hides one: those are not required.
    """
    rng = np.random.default_rng(seed)
    is_open = rng.random() < OPEN_SHARE
    kind = str(rng.choice(detector_scenes.POSITIVE if is_open else detector_scenes.NEGATIVE))
    for _ in range(MAX_DRAWS):
        scene = detector_scenes.draw(rng, kind, studio.wheelchair.camera.x)
        if scene is None:
            continue
        image, truth = studio.look(scene.boxes, scene.base, rng)
        required = is_open and studio.sees_jambs(scene.openings[0], scene.base, truth)
        if required or kind in detector_scenes.NEGATIVE or kind == "leaf_in_room":
            return scene, image, required
    raise RuntimeError("no scene of kind %s fits in %d draws" % (kind, MAX_DRAWS))


def examine(studio, seed, frames=1):
    """``Result`` of the scene of ``seed``: of one frame, or of several ``frames`` fused by the tracker.

    The further frames are taken while the chair moves a little: up to 0.05 m and 2 degrees about the first place.
    """
    scene, image, required = draw(studio, seed)
    detection = doorway.detect_depth(image, studio.camera, studio.base_from_camera, studio.detector_settings, seed)
    told = detection.doorways
    poses = [se2.compose(scene.base, found.pose) for found in told]
    if frames > 1:
        told = _fused(studio, scene, detection, frames, seed)
        poses = [found.pose for found in told]
    taken = set()
    error = np.full(4, np.nan)
    found = False
    for index, opening in enumerate(scene.openings):
        for k, (pose, item) in enumerate(zip(poses, told)):
            if k in taken or not matches(pose, opening.pose):
                continue
            taken.add(k)
            if index == 0:
                found = True
                across, along, turn = se2.compose(se2.inverse(opening.pose), pose)
                error = np.array([across, along, turn, item.width - opening.width])
            break
    false = tuple(pose for k, pose in enumerate(poses) if k not in taken)
    return Result(seed, scene, required, found, error, false, len(taken), detection, image)


def _fused(studio, scene, first, frames, seed):
    """Doorways (tuple, in the world) that the tracker tells after ``frames`` frames, of which ``first`` is one."""
    rng = np.random.default_rng((seed, frames))
    tracker = DoorwayTracker(studio.detector_settings)
    told = ()
    for k in range(frames):
        base, detection = scene.base, first
        if k:
            base = scene.base + rng.uniform(-1.0, 1.0, 3) * (0.05, 0.05, np.radians(2.0))
            image, _ = studio.look(scene.boxes, base, rng)
            detection = doorway.detect_depth(image, studio.camera, studio.base_from_camera, studio.detector_settings,
                                             seed, 0.1 * k)
        told = tracker.update([in_frame(base, found) for found in detection.doorways], base, 0.1 * k)
    return told


def matches(pose, expected):
    """Within 0.3 m and 15 degrees of what is expected (poses (3,))?"""
    away = np.hypot(*(pose[:2] - expected[:2]))
    return bool(away <= MATCH_DISTANCE and abs(se2.wrap_angle(pose[2] - expected[2])) <= MATCH_ANGLE)
