"""A mesh file as a world, and the ray caster that sees meshes (open3d)."""
import numpy as np

from wheelchair_shared_control import camera as cameras
from wheelchair_shared_control.simulation.world import SceneError, World

LARGEST = 5000000  # triangles


def load(path):
    """The world of an ``.obj``, ``.stl``, ``.dae`` or ``.ply`` file in metres, z up. Raises SceneError."""
    import open3d

    path = str(path)
    try:
        with open3d.utility.VerbosityContextManager(open3d.utility.VerbosityLevel.Error):
            mesh = open3d.io.read_triangle_mesh(path)
    except Exception as error:  # open3d raises RuntimeError for some broken files, returns an empty mesh for others
        raise SceneError("%s: cannot be read as a mesh: %s" % (path, " ".join(str(error).split())))
    vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    if len(triangles) == 0:
        raise SceneError("%s: cannot be read as a mesh: no triangles in it" % path)
    if len(triangles) > LARGEST:
        raise SceneError("%s: has %d triangles, but must have at most %d" % (path, len(triangles), LARGEST))
    if not np.all(np.isfinite(vertices)):
        raise SceneError("%s: holds vertices that are not finite" % path)
    name = path.rsplit("/", 1)[-1]
    return World(boxes=np.zeros((0, 7)), meshes=((vertices.astype(float), triangles.astype(np.int64)),),
                 names=(name,), name=name)


class Caster:
    """Rays into meshes, by open3d's ray caster; ``triangles`` (n, 3, 3) [m] are all of theirs."""

    def __init__(self, meshes):
        import open3d

        self.triangles = np.ascontiguousarray(np.concatenate(
            [np.asarray(vertices, dtype=np.float64)[np.asarray(triangles)] for vertices, triangles in meshes]))
        self._tensor = open3d.core.Tensor
        self._scene = open3d.t.geometry.RaycastingScene()
        for vertices, triangles in meshes:
            self._scene.add_triangles(self._tensor(np.ascontiguousarray(vertices, dtype=np.float32)),
                                      self._tensor(np.ascontiguousarray(triangles, dtype=np.uint32)))
        self._rays, self._directions = None, {}

    def distances(self, rays):
        """Distance [m] to the nearest mesh along ``rays`` (..., 6) in the world; +Inf where none is met."""
        return self._scene.cast_rays(self._tensor(np.ascontiguousarray(rays, dtype=np.float32)))["t_hit"].numpy()

    def add_to(self, inverse, plane, camera, world_from_camera):
        """Draw the meshes into what ``zbuffer.render`` returned, where they are nearer."""
        if camera not in self._directions:
            self._directions = {camera: cameras.back_project(camera, np.ones((camera.height, camera.width)))}
        rays = np.empty((camera.height, camera.width, 6), dtype=np.float32)
        rays[..., :3] = world_from_camera[:3, 3]
        rays[..., 3:] = self._directions[camera] @ world_from_camera[:3, :3].T
        hits = self._scene.cast_rays(self._tensor(rays))
        # the directions have unit depth, so that the ray's parameter is the depth
        depth, normals = hits["t_hit"].numpy(), hits["primitive_normals"].numpy()
        with np.errstate(divide="ignore", invalid="ignore"):
            nearer = np.isfinite(depth) & (1.0 / depth > inverse)
        facing = np.abs(np.sum(normals * rays[..., 3:], axis=-1))
        inverse[nearer] = 1.0 / depth[nearer]
        plane[nearer] = (depth * facing)[nearer]
