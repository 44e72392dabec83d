"""The chair's sensors in a world: depth camera and rangers, each with its own stream of noise."""
import numpy as np

from wheelchair_shared_control import camera as cameras
from wheelchair_shared_control.simulation import depth_noise, rangers, zbuffer
from wheelchair_shared_control.simulation.zbuffer import render_boxes  # noqa: F401  (part of this module's names)

DRAWN = 200000  # triangles: meshes up to this size are drawn, larger ones met by rays, whose time grows slower


class DepthCamera:
    """A depth camera on the chair; ``size`` (width, height) other than the full one scales the lens."""

    def __init__(self, settings, rng, size=None, caster=None):
        wheelchair = settings.wheelchair
        full = cameras.from_settings(wheelchair)
        self.camera = full if size is None else cameras.scaled(full, *size)
        self._base_from_camera = cameras.mounting(wheelchair)
        self._max_range = wheelchair.camera.max_range
        self._noise = depth_noise.DepthNoise(settings.depth_noise, wheelchair, rng)
        self._caster = caster
        shape = (self.camera.height, self.camera.width)
        self._buffers = np.empty(shape, np.float32), np.empty(shape, np.float32)

    def frame(self, boxes, pose):
        """Noisy depth image (height, width) float32 [m] seen by the chair at ``pose`` (3,) in the world."""
        inverse, plane = self._see(boxes, pose)
        return self._noise.apply(inverse, plane, self.camera)

    def truth(self, boxes, pose):
        """The same without noise or limits of range; +Inf where nothing is seen."""
        inverse, _ = self._see(boxes, pose)
        with np.errstate(divide="ignore"):
            return np.float32(1.0) / inverse

    def _see(self, boxes, pose):
        world_from_camera = cameras.lifted(pose) @ self._base_from_camera
        inverse, plane = zbuffer.render(boxes, self.camera, world_from_camera, self._max_range + 0.5,
                                        out=self._buffers)
        if self._caster is not None:
            if len(self._caster.triangles) <= DRAWN:
                zbuffer.render_triangles(self._caster.triangles, self.camera, world_from_camera,
                                         self._max_range + 0.5, self._buffers)
            else:
                self._caster.add_to(inverse, plane, self.camera, world_from_camera)
        return inverse, plane


class Rangers:
    """The six infrared rangers."""

    def __init__(self, settings, rng, caster=None):
        self._wheelchair, self._noise, self._rng, self._caster = (
            settings.wheelchair, settings.ranges_noise, rng, caster)
        self._rays = rangers.rays(settings.wheelchair)

    def readings(self, boxes, pose):
        """Readings (6,) [m] in the order of ``RANGERS`` at ``pose`` (3,) in the world."""
        rays = rangers.in_world(self._rays, pose)
        true = rangers.distances(boxes, rays, 2.0 * self._wheelchair.rangers.max_range)
        if self._caster is not None:
            true = np.minimum(true, self._caster.distances(rays).min(axis=1))
        return rangers.measure(true, self._wheelchair, self._noise, self._rng)


def add_noise(depth, rng, settings, camera=None, wheelchair=None):
    """A depth image (height, width) [m] with the sensor's noise and limits of range.

    ``settings`` is the simulator's. Without the planes that were seen, grazing faces stay valid; edges are
    taken from the jumps in depth. ``camera`` defaults to the full-size one scaled to the image.
    """
    wheelchair = settings.wheelchair if wheelchair is None else wheelchair
    depth = np.asarray(depth, dtype=np.float32)
    if camera is None:
        camera = cameras.scaled(cameras.from_settings(wheelchair), depth.shape[1], depth.shape[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(np.isfinite(depth) & (depth > 0.0), np.float32(1.0) / depth, np.float32(0.0))
    # planes unknown: each pixel faces the camera, so only the jump in depth tells an edge
    plane = np.where(inverse > 0.0, depth * np.float32(10.0), np.float32(0.0)).astype(np.float32)
    return depth_noise.DepthNoise(settings.depth_noise, wheelchair, rng).apply(
        inverse.astype(np.float32), plane, camera)
