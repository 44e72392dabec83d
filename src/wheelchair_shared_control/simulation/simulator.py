"""The simulator: one chair in one world, by plain calls; the same seed and commands give the same bits."""
from collections import OrderedDict
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control import se2
from wheelchair_shared_control.simulation import outlines, scenes
from wheelchair_shared_control.simulation.engine import pybullet
from wheelchair_shared_control.simulation.sensors import DepthCamera, Rangers
from wheelchair_shared_control.simulation.wheelchair import Wheelchair
from wheelchair_shared_control.simulation.world import SceneError
from wheelchair_shared_control.values import Depth, Odometry, Ranges

# Collision groups, and whom each may meet: wheels and castors roll on the floor, the chair's prism meets the world.
# The person meets nobody: they are not pushed about by physics, their touches are found by distance.
WORLD_GROUP, FLOOR_GROUP, PERSON_GROUP = 1, 2, 16
CHAIR_MASK, ROLLING_MASK, NOBODY = 8, 4, 0
ALL_AT_ONCE = 150  # boxes: worlds up to this size are held as a whole
REFRESH = 1.0      # m: of larger ones the neighbourhood, chosen anew after this way
MESH_PIECE = 20000  # triangles that pybullet is given at once: it refuses large meshes
CLEARANCE_CAP = 5.0  # m
TOUCHABLE = 0.5    # m from the outline: what physics must hold


class Touch(NamedTuple):
    """The chair met ``name`` at ``time`` [s], driving at ``v``, ``w``; ``place`` (2,) [m] in base_link."""

    time: float
    name: str
    depth: float
    v: float
    w: float
    place: np.ndarray


class Simulator:
    """A chair in a ``World``.

    ``settings``: ``parameters.load("simulator")``; ``start`` (3,) pose of base_link in the world; ``camera``
    (width, height) of the depth image, default as in the settings; ``person``: a ``Person`` who walks through.
    Time starts at 0; odometry starts at (0, 0, 0). Call ``close`` when done.
    """

    def __init__(self, world, settings, seed, start, camera=None, person=None):
        self.world, self.settings, self.person = world, settings, person
        self._size = tuple(camera) if camera is not None else (settings.camera_width, settings.camera_height)
        self._all_shapes = outlines.from_world(world)
        camera, rangers = settings.wheelchair.camera, settings.wheelchair.rangers
        self._visible = 1.6 * max(camera.max_range, rangers.max_range) + abs(camera.x)  # corners of the view
        self._caster = None
        if world.meshes:
            from wheelchair_shared_control.simulation.meshes import Caster
            self._caster = Caster(world.meshes)
        self._client = None
        self.reset(seed, start)

    def reset(self, seed=None, start=None, person=None):
        """Begin anew: time 0, everything at rest, noise drawn again from ``seed`` (default: as before)."""
        self.close()
        self.seed = self.seed if seed is None else int(seed)
        self._start = np.array(self._start if start is None else start, dtype=float)
        self.person = self.person if person is None else person
        noise = [np.random.default_rng([self.seed, scenes.NOISE_STREAM, k]) for k in range(3)]
        self._client = pybullet.connect(pybullet.DIRECT)
        p = self._client
        pybullet.setGravity(0.0, 0.0, -9.81, physicsClientId=p)
        pybullet.setPhysicsEngineParameter(fixedTimeStep=self.settings.physics_step, numSubSteps=0,
                                           numSolverIterations=30, deterministicOverlappingPairs=1,
                                           physicsClientId=p)
        floor = pybullet.createMultiBody(
            0.0, pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=p), physicsClientId=p)
        pybullet.changeDynamics(floor, -1, lateralFriction=1.0, restitution=0.0, physicsClientId=p)
        pybullet.setCollisionFilterGroupMask(floor, -1, FLOOR_GROUP, ROLLING_MASK, physicsClientId=p)
        self._bodies, self._names, self._populated_at = OrderedDict(), {}, None
        self.chair = Wheelchair(p, self.settings, noise[0])
        self._add_meshes()
        self._depth_camera = DepthCamera(self.settings, noise[1], self._size, self._caster)
        self._rangers = Rangers(self.settings, noise[2], self._caster)
        self._person_body = None if self.person is None else self._add_box(self.person.box(0.0), PERSON_GROUP, NOBODY)
        self._steps, self._asked, self._contacts, self.touches = 0, 0.0, {}, []
        self.chair.restart(self._start)
        self._populate()

    def close(self):
        """End the physics client; calling it twice does no harm."""
        if self._client is not None:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    @property
    def time(self):
        """Simulated time [s] since the start."""
        return self._steps * self.settings.physics_step

    @property
    def camera(self):
        """Intrinsics of the depth image."""
        return self._depth_camera.camera

    def command(self, v, w):
        """A command [m/s, rad/s], valid for ``command_timeout``; what is not finite counts as zero."""
        self.chair.command(self.time, v, w)

    def advance(self, dt):
        """Carry physics on by ``dt`` [s], in whole physics steps; what is left over is kept for the next call."""
        self._asked += dt
        self._contacts = {}
        step = self.settings.physics_step
        while (self._steps + 1) * step <= self._asked + 1e-9:
            self._populate_when_due()
            self.chair.before_step(self.time)
            if self._person_body is not None:
                self._move_person()
            pybullet.stepSimulation(physicsClientId=self._client)
            self._steps += 1
            self.chair.after_step()
            self._note_contacts()

    def joints(self, since):
        """Angles [rad] of wheels and castors by the URDF's names; castors turn with the motion of ``since`` [s]."""
        self.chair.roll_castors(since)
        return self.chair.joints()

    def truth(self):
        """True pose in the world and velocity in the body frame."""
        return Odometry(self.time, self.chair.pose.copy(), self.chair.twist())

    def odometry(self):
        """Pose in odom and velocity, as the wheels' encoders have them."""
        return self.chair.odometry(self.time)

    def depth(self):
        """A depth frame of now."""
        image = self._depth_camera.frame(self._boxes(), self.chair.pose)
        image.setflags(write=False)  # as an image that came as a message
        return Depth(self.time, image)

    def ranges(self):
        """Readings of the six rangers of now."""
        return Ranges(self.time, self._rangers.readings(self._boxes(), self.chair.pose))

    def contacts(self):
        """What the chair met during the last ``advance``: list of (name, depth [m]), deepest first."""
        return sorted(self._contacts.items(), key=lambda item: (-item[1], item[0]))

    def clearance(self):
        """True distance [m] from the footprint polygon to the world in the heights 0.05-1.30 m.

        0 on contact; at most 5 m.
        """
        polygon = footprints.corners(self.chair.footprint, self.chair.pose)
        distance = outlines.clearance(self._shapes, polygon, CLEARANCE_CAP)
        if self.person is not None:
            person = outlines.from_boxes(np.array([self.person.box(self.time)]))[0, :4]
            distance = min(distance, outlines.polygon_distance(polygon, person))
        return float(distance)

    def set_pose(self, pose):
        """Set the chair down at rest at ``pose`` (3,) in the world; its odometry does not notice.

        Raises SceneError for a pose that is not finite.
        """
        pose = np.asarray(pose, dtype=float)
        if not np.all(np.isfinite(pose)):
            raise SceneError("pose (%g, %g, %g) is not finite" % tuple(pose))
        self.chair.place(pose)
        self._contacts = {}
        self._populate()

    def _boxes(self):
        if self.person is None:
            return self._near_boxes
        return np.vstack((self._near_boxes, self.person.box(self.time)))

    def _move_person(self):
        x, y, z, yaw = self.person.box(self.time + self.settings.physics_step)[:4]
        pybullet.resetBasePositionAndOrientation(
            self._person_body, [x, y, z], [0.0, 0.0, np.sin(yaw / 2.0), np.cos(yaw / 2.0)],
            physicsClientId=self._client)

    def _note_contacts(self):
        for point in pybullet.getContactPoints(self.chair.identity, linkIndexA=-1, physicsClientId=self._client):
            if point[8] <= 0.0:
                self._note(self._names[point[2]], -point[8], point[5])
        if self._person_body is not None:
            for point in pybullet.getClosestPoints(self.chair.identity, self._person_body, 0.0, -1, -1,
                                                   physicsClientId=self._client):
                self._note("person", -point[8], point[5])

    def _note(self, name, depth, where):
        if name not in self._contacts:
            place = se2.transform_points(se2.inverse(self.chair.pose), np.array([where[:2]]))[0]
            self.touches.append(Touch(self.time, name, depth, *self.chair.twist(), place))
        self._contacts[name] = max(depth, self._contacts.get(name, 0.0))

    def _populate_when_due(self):
        if self._populated_at is not None:
            x, y = self.chair.pose[0] - self._populated_at[0], self.chair.pose[1] - self._populated_at[1]
            if x * x + y * y > REFRESH * REFRESH:
                self._populate()

    def _populate(self):
        """Choose what physics and sensors hold: all of a small world, the neighbourhood of a large one."""
        boxes, names = self.world.boxes, self.world.names
        touchable = (boxes[:, 2] - boxes[:, 6] < outlines.HIGH) & (boxes[:, 2] + boxes[:, 6] > outlines.LOW)
        self._near_boxes, self._shapes, self._populated_at = boxes, self._all_shapes, None
        if len(boxes) > ALL_AT_ONCE:
            place = self.chair.pose[:2].copy()
            away = np.hypot(boxes[:, 0] - place[0], boxes[:, 1] - place[1]) - np.hypot(boxes[:, 4], boxes[:, 5])
            self._near_boxes = boxes[away < self._visible + REFRESH]
            reach = self.chair.footprint.circumscribed_radius + REFRESH
            self._shapes = outlines.near(self._all_shapes, place, CLEARANCE_CAP + reach)
            touchable &= away < TOUCHABLE + reach
            self._populated_at = place
        for index in [index for index in self._bodies if not touchable[index]]:
            body = self._bodies.pop(index)
            del self._names[body]
            pybullet.removeBody(body, physicsClientId=self._client)
        for index in np.nonzero(touchable)[0]:
            if int(index) not in self._bodies:
                body = self._add_box(boxes[index], WORLD_GROUP, CHAIR_MASK)
                self._bodies[int(index)] = body
                self._names[body] = names[index]

    def _add_box(self, row, group, mask):
        shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=list(row[4:7]),
                                              physicsClientId=self._client)
        body = pybullet.createMultiBody(
            0.0, shape, basePosition=list(row[:3]),
            baseOrientation=[0.0, 0.0, np.sin(row[3] / 2.0), np.cos(row[3] / 2.0)], physicsClientId=self._client)
        pybullet.setCollisionFilterGroupMask(body, -1, group, mask, physicsClientId=self._client)
        pybullet.changeDynamics(body, -1, lateralFriction=0.5, restitution=0.0, physicsClientId=self._client)
        return body

    def _add_meshes(self):
        for index, (vertices, triangles) in enumerate(self.world.meshes):
            corners = np.asarray(vertices, dtype=float)[np.asarray(triangles, dtype=int)]
            heights = corners[:, :, 2]
            touchable = corners[(heights.min(axis=1) < outlines.HIGH) & (heights.max(axis=1) > outlines.LOW)]
            for begin in range(0, len(touchable), MESH_PIECE):
                piece = touchable[begin:begin + MESH_PIECE].reshape(-1, 3)
                shape = pybullet.createCollisionShape(
                    pybullet.GEOM_MESH, vertices=piece.tolist(), indices=list(range(len(piece))),
                    flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH, physicsClientId=self._client)
                body = pybullet.createMultiBody(0.0, shape, physicsClientId=self._client)
                pybullet.setCollisionFilterGroupMask(body, -1, WORLD_GROUP, CHAIR_MASK, physicsClientId=self._client)
                self._names[body] = self.world.names[len(self.world.boxes) + index]
