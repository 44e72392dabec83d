"""How long the parts of a tick take, each beside a named peer that does the same, in the same run."""
import time
import warnings

import numpy as np

from wheelchair_shared_control import camera as cameras
from wheelchair_shared_control import doorway, features, se2
from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control.assistance import ASSISTING
from wheelchair_shared_control.costmap import Costmap, to_grid
from wheelchair_shared_control.experiments import episode, graph, options
from wheelchair_shared_control.experiments.plain_costmap import PlainCostmap, plain_features
from wheelchair_shared_control.grid import LETHAL, Grid
from wheelchair_shared_control.planning.navigation import Navigator
from wheelchair_shared_control.shared_control import Inputs, SharedControl
from wheelchair_shared_control.simulation.simulator import Simulator
from wheelchair_shared_control.task_model import TaskModel
from wheelchair_shared_control.values import Twist

SEED = 1
BATCH = 100000


def timed(call, repetitions, budget=10.0):
    """Times (n,) [ms] of ``call(k)``, at most ``budget`` seconds in all, after two calls that do not count."""
    call(0)
    call(1)
    times, end = [], time.perf_counter() + budget
    for k in range(repetitions):
        start = time.perf_counter()
        call(k)
        now = time.perf_counter()
        times.append(1000.0 * (now - start))
        if now > end:
            break
    return np.array(times)


def row(ours, reference_name, reference):
    """One entry of the JSON: medians, the 99th percentile, and how many times the peer takes."""
    median, other = float(np.median(ours)), float(np.median(reference))
    return {
        "median_ms": median, "p99_ms": float(np.percentile(ours, 99)), "n": len(ours),
        "reference": reference_name, "reference_ms": other, "ratio": other / median,
    }


class Drive:
    """Frames, poses and grids of one crossing, recorded at 10 Hz, so that every part works on what it meets."""

    def __init__(self):
        chosen = options.Options(policy="distance", detector=False, scene="hallway")
        run = episode.Episode(chosen, SEED)
        self.settings, self.door = run.settings, run.door
        self.frames, self.odometry, self.snapshots, self.ranges, self.truths = [], [], [], [], []
        self.planners = []
        with Simulator(run.world, run.settings.simulator, SEED, run.setup.start, chosen.camera) as simulator:
            loop = graph.Graph(chosen, run.setup, SEED, run.settings, simulator)
            while simulator.time < 9.0:
                odometry, truth = simulator.odometry(), simulator.truth()
                loop.tick()
                if loop.depth.stamp == odometry.stamp:
                    self.frames.append(loop.depth)
                    self.odometry.append(odometry)
                    self.truths.append(truth)
                    self.snapshots.append(loop.snapshot)
                    self.ranges.append(loop.ranges)
                    decided = None if loop.decision is None else loop.decision.command
                    self.planners.append(decided or Twist(0.3, 0.0))
        self.wheelchair = self.settings.navigation.wheelchair
        self.camera = cameras.from_settings(self.wheelchair)
        self.mounting = cameras.mounting(self.wheelchair)

    def __len__(self):
        return len(self.frames)


def costmap_update(drive):
    """One full depth frame into the costmap, beside the same in NumPy and scipy."""
    local = drive.settings.navigation.local_costmap
    costmap = Costmap(local, drive.wheelchair)

    def ours(k):
        k %= len(drive)
        pose = drive.odometry[k].pose
        costmap.move_to(pose)
        costmap.insert_depth(drive.frames[k].image, drive.camera, cameras.lifted(pose) @ drive.mounting, float(k))
        costmap.update(pose, float(k))

    snapshot = drive.snapshots[0]
    plain = PlainCostmap(local, snapshot.cost.shape, snapshot.origin)
    radius = footprints.from_settings(drive.wheelchair).inscribed_radius

    def peer(k):
        k %= len(drive)
        transform = cameras.lifted(drive.odometry[k].pose) @ drive.mounting
        plain.update(drive.frames[k].image, drive.camera, transform, radius)

    return row(timed(ours, 300), "NumPy and scipy, vectorised", timed(peer, 60))


def control_cycle(drive):
    """Search and following in one cycle of the navigator; the peer searches anew in every cycle."""
    goal = se2.compose(drive.odometry[0].pose, se2.compose(se2.inverse(drive.truths[0].pose), drive.door.pose))
    goal = se2.compose(goal, np.array([1.0, 0.0, 0.0]))

    def follower(anew):
        navigator = Navigator(drive.settings.navigation)
        state = {"previous": len(drive)}

        def cycle(k):
            k %= len(drive)
            if k < state["previous"] or anew:
                navigator.set_goal(goal, drive.odometry[k].stamp)
            state["previous"] = k
            now = drive.odometry[k].stamp
            navigator.update(now, drive.odometry[k], drive.snapshots[k]._replace(stamp=now), user=Twist(0.3, 0.0))

        return cycle

    return row(timed(follower(False), 400), "the same with a new search in every cycle", timed(follower(True), 100))


def detection(drive):
    """One frame from raw depth to doorways, beside open3d's RANSAC for three planes on the half-resolution points."""
    import open3d as o3d

    def ours(k):
        k %= len(drive)
        doorway.detect_depth(drive.frames[k].image, drive.camera, drive.mounting, drive.settings.detector, seed=SEED)

    def peer(k):
        image = drive.frames[k % len(drive)].image
        points = cameras.back_project(drive.camera, image)[::2, ::2].reshape(-1, 3)
        points = points[np.isfinite(points).all(axis=1)].astype(float)
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
        for _ in range(3):
            _, inliers = cloud.segment_plane(0.02, 3, 1000)
            cloud = cloud.select_by_index(inliers, invert=True)
            if len(cloud.points) < 100:
                break

    return row(timed(ours, 100), "open3d segment_plane, three planes, half resolution", timed(peer, 20))


def feature_distances(drive):
    """The paper's three distances in a grid of 240 x 240 cells, a fifth of it occupied."""
    rng = np.random.default_rng(SEED)
    cells = np.where(rng.random((240, 240)) < 0.2, LETHAL, 0).astype(np.int8)
    cells[90:150, 80:170] = 0
    grid = Grid(cells, 0.025, (-3.0, -3.0), 0.0)
    chair = footprints.from_settings(drive.wheelchair)
    poses = rng.uniform(-0.2, 0.2, (100, 3))
    return row(
        timed(lambda k: features.distances(grid, poses[k % 100], chair), 500), "NumPy, vectorised",
        timed(lambda k: plain_features(grid, poses[k % 100], chair), 100),
    )


def regression(model):
    """One query and one batch of the task model, beside the package gmr; None where gmr is not installed."""
    try:
        from gmr import GMM
    except ImportError:
        return None, None
    rng = np.random.default_rng(SEED)
    inputs = np.column_stack((rng.uniform(0.05, 2.0, (BATCH, 3)), rng.uniform(0.0, 0.6, BATCH)))
    peer = GMM(model.components, model.weights, model.means, model.covariances)

    def condition(k):
        peer.condition([0, 1, 2, 3], inputs[k % BATCH]).to_mvn()

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        one = timed(condition, 300)
        mean_alone = timed(lambda k: peer.predict(np.arange(4), inputs[:2000]), 5, budget=5.0)
    query = row(timed(lambda k: model.predict(*inputs[k % BATCH]), 20000, 5.0), "gmr condition().to_mvn()", one)
    batch = row(timed(lambda k: model.predict_many(inputs), 30) / BATCH, "gmr condition().to_mvn(), per query", one)
    batch["mean_alone_reference"] = "gmr.predict, per query"
    batch["mean_alone_ratio"] = float(np.median(mean_alone)) / 2000 / batch["median_ms"]
    return query, batch


def blend_tick(drive, model):
    """One tick of the blender: features, query, blend, limiter, guard; the peer is the tick without the guard."""
    grids = [to_grid(snapshot) for snapshot in drive.snapshots]

    def ticker(guard_on):
        control = SharedControl(drive.settings.blender, "learned_variance", guard_on)
        control.density_floor = model.density_quantiles[0.05]

        def tick(k):
            k %= len(drive)
            now = drive.odometry[k].stamp
            planner = drive.planners[k]
            inputs = Inputs(
                now, user=Twist(0.35, 0.6), user_stamp=now, planner=planner, planner_stamp=now,
                odometry=drive.odometry[k], grid=grids[k]._replace(stamp=now), grid_received=now,
                ranges=drive.ranges[k]._replace(stamp=now) if drive.ranges[k] is not None else None,
                assistance=ASSISTING,
            )
            query = control.query(inputs)
            control.update(inputs, model.predict(*query))

        return tick

    return row(timed(ticker(True), 600), "the same without the guard", timed(ticker(False), 300))


def whole_episode():
    """An episode with the full Kinect and the detector; the peer is real time."""
    chosen = options.Options()
    episode.Episode(chosen, SEED).run()
    times, simulated = [], []
    for seed in range(SEED + 1, SEED + 4):
        run = episode.Episode(chosen, seed)
        start = time.perf_counter()
        result = run.run()
        times.append(1000.0 * (time.perf_counter() - start))
        simulated.append(1000.0 * result["duration_s"])
    result = row(np.array(times), "real time", np.array(simulated))
    result["realtime_factor"] = float(np.sum(simulated) / np.sum(times))
    return result


def run(progress):
    """All figures as {name: entry}; ``progress`` wraps the list of parts."""
    model, drive, figures = TaskModel.load("paper"), Drive(), {}
    parts = {
        "costmap_update": lambda: costmap_update(drive),
        "control_cycle": lambda: control_cycle(drive),
        "detection": lambda: detection(drive),
        "features": lambda: feature_distances(drive),
        "gmr": lambda: regression(model),
        "blend_tick": lambda: blend_tick(drive, model),
        "episode": whole_episode,
    }
    for name in progress(list(parts)):
        value = parts[name]()
        figures.update(dict(zip(("gmr_query", "gmr_batch"), value)) if name == "gmr" else {name: value})
    return {name: value for name, value in figures.items() if value is not None}


def table(figures):
    """The figures as Markdown."""
    lines = ["| part | median [ms] | 99th pct. [ms] | peer | peer's median [ms] | ratio |", "|---|---|---|---|---|---|"]
    for name, f in figures.items():
        lines.append(
            "| `%s` | %.3g | %.3g | %s | %.3g | %.1f |"
            % (name, f["median_ms"], f["p99_ms"], f["reference"], f["reference_ms"], f["ratio"])
        )
    return "\n".join(lines)
