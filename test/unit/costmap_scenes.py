"""Depth images of boxes on a floor, by open3d's ray caster, with the Kinect's noise on request."""
import numpy as np
import open3d

from wheelchair_shared_control import camera as cameras
from wheelchair_shared_control import parameters

SETTINGS = parameters.load("move_base")
CHAIR = SETTINGS.wheelchair
CAMERA = cameras.scaled(cameras.from_settings(CHAIR), 320, 240)


def box(x0, x1, y0, y1, z0, z1):
    """A box between two corners [m]."""
    mesh = open3d.t.geometry.TriangleMesh.create_box(x1 - x0, y1 - y0, z1 - z0)
    return mesh.translate([x0, y0, z0])


def floor(x0=-10.0, x1=10.0, z=0.0):
    """A slab whose top lies at ``z``."""
    return box(x0, x1, -10.0, 10.0, z - 0.1, z)


def door(width, x=0.0, y=0.0, lintel=2.0):
    """A wall 0.12 m thick across the x axis at ``x``, with a gap of ``width`` about ``y``."""
    near, far = x - 0.06, x + 0.06
    return [
        box(near, far, y + width / 2, y + 5.0, 0.0, 2.5),
        box(near, far, y - 5.0, y - width / 2, 0.0, 2.5),
        box(near, far, y - width / 2, y + width / 2, lintel, 2.5),
    ]


class Renderer:
    """Depth images (height, width) float32 [m] of a list of boxes; +Inf where nothing lies in range."""

    def __init__(self, boxes, camera=CAMERA, max_range=CHAIR.camera.max_range):
        self.scene = open3d.t.geometry.RaycastingScene(nthreads=1)
        for mesh in boxes:
            self.scene.add_triangles(mesh)
        self.camera = camera
        self.max_range = max_range

    def depth(self, pose, pitch=None, rng=None):
        """The image from ``pose`` (3,) of the chair in the world; with ``rng``, with noise."""
        pitch = CHAIR.camera.pitch if pitch is None else pitch
        mount = cameras.base_from_camera(CHAIR.camera.x, CHAIR.camera.z, pitch)
        world_from_camera = cameras.lifted(pose) @ mount
        c = self.camera
        rays = open3d.t.geometry.RaycastingScene.create_rays_pinhole(
            np.array([[c.fx, 0, c.cx + 0.5], [0, c.fy, c.cy + 0.5], [0, 0, 1]]),
            np.linalg.inv(world_from_camera), c.width, c.height)
        cast = self.scene.cast_rays(rays, nthreads=1)
        # the rays are not of unit length: their z in the optical frame is 1, and t_hit is the depth
        depth = cast["t_hit"].numpy().astype(np.float32)
        if rng is not None:
            depth = noisy(depth, cast["primitive_normals"].numpy(), rays.numpy()[..., 3:], rng)
        depth[np.isfinite(depth) & (depth > self.max_range)] = np.inf
        depth[depth < CHAIR.camera.min_range] = -np.inf
        return depth


def noisy(depth, normals, directions, rng):
    """Kinect: sigma_z, quantised disparity, invalid beyond 80 degrees of incidence and 2 px at edges."""
    depth = np.where(np.isfinite(depth), depth, np.float32(1e3))
    out = depth + rng.standard_normal(depth.shape).astype(np.float32) * (0.0012 + 0.0019 * (depth - 0.4) ** 2)
    base = cameras.from_settings(CHAIR).fx * 0.075
    disparity = np.round(base / out * 8.0) / 8.0
    with np.errstate(divide="ignore", invalid="ignore"):
        out = np.where(depth < 100.0, base / disparity, np.inf).astype(np.float32)
        cos = np.abs((normals * directions).sum(-1)) / np.linalg.norm(directions, axis=-1)
        edge = np.zeros(depth.shape, bool)
        for axis in (0, 1):
            jump = np.abs(np.diff(1.0 / depth, axis=axis)) > 0.04 / np.minimum(
                depth[1:] if axis == 0 else depth[:, 1:], depth[:-1] if axis == 0 else depth[:, :-1]) ** 1
            rows, columns = np.nonzero(jump)
            for k in range(-1, 3):
                if axis == 0:
                    edge[np.clip(rows + k, 0, depth.shape[0] - 1), columns] = True
                else:
                    edge[rows, np.clip(columns + k, 0, depth.shape[1] - 1)] = True
    out[edge] = np.nan
    out[(depth < 100.0) & (cos < np.cos(np.radians(80.0)))] = np.nan
    return out
