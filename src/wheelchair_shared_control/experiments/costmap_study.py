"""How well the costmap knows a door while the chair drives through it: error of clearance, and of the jambs.

``python3 -m wheelchair_shared_control.experiments.costmap_study --door-width 0.75 --episodes 20 --seed 1`` drives
``evaluate --policy planner --detector truth`` and compares each grid with the truth of its instant.
"""
import sys

import numpy as np

from wheelchair_shared_control import command_line, se2
from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control.experiments import episode, options
from wheelchair_shared_control.grid import LETHAL, Grid, occupied_points
from wheelchair_shared_control.planning import clearance

NEAR = 0.15  # m of true clearance up to which its error counts
BESIDE = 0.10  # m inside the jamb: from there its distance is read
STAGES = (("approach, to 1.5 m", -9.0, -1.5), ("to 1.0 m, jambs go out of view", -1.5, -1.0),
          ("to 0.3 m", -1.0, -0.3), ("in the door", -0.3, 0.4))


class Study:
    """Collects the errors of one episode's grids; ``watch`` is called after every tick."""

    def __init__(self, run):
        self.door = run.door
        self.width = run.door.width
        footprint = footprints.from_settings(run.settings.navigation.wheelchair)
        self._body = clearance.make_body(footprint)
        self._seen = None
        self.clearances = []  # perceived minus true [m]
        self.jambs = []  # x of base_link before the plane, error of the cells, of the surface [m]; two a grid

    def watch(self, graph, simulator):
        snapshot = graph.snapshot
        if snapshot is None or snapshot is self._seen:
            return
        self._seen = snapshot
        odom = simulator.odometry().pose
        true = simulator.clearance()
        field = clearance.make_field(snapshot)
        if 0.0 < true < NEAR:
            seen = clearance.clearances(field.distance, field.frame, *self._body, 2.0 * NEAR, odom[None])[0]
            self.clearances.append(seen - true)
        door_from_base = se2.compose(se2.inverse(self.door.pose), simulator.truth().pose)
        door_from_odom = se2.compose(door_from_base, se2.inverse(odom))
        grid = Grid(np.where(snapshot.cost == 254, LETHAL, 0).astype(np.int8), snapshot.resolution,
                    snapshot.origin, snapshot.stamp)
        points = se2.transform_points(door_from_odom, occupied_points(grid))
        half, thick = self.width / 2.0, self.door.thickness / 2.0
        odom_from_door = se2.inverse(door_from_odom)
        for side in (1.0, -1.0):
            beside = points[:, 1] * side
            in_wall = np.abs(points[:, 0]) < thick + snapshot.resolution
            jamb = beside[in_wall & (beside > 0.0) & (beside < half + NEAR)]
            if not jamb.size:
                continue
            along = np.linspace(-thick, thick, 7)
            inside = se2.transform_points(
                odom_from_door, np.column_stack((along, np.full(7, side * (half - BESIDE)))))
            surface = min(clearance.field_at(field.distance, field.frame, x, y) for x, y in inside) - BESIDE
            self.jambs.append((door_from_base[0], jamb.min() - half, surface))


def describe(errors):
    """Mean, deviation and range of ``errors`` (n,) [m], in millimetres."""
    errors = 1e3 * np.asarray(errors, dtype=float)
    if not errors.size:
        return {"n": 0}
    low, high = np.percentile(errors, (5.0, 95.0))
    return {"n": errors.size, "mean_mm": errors.mean(), "sd_mm": errors.std(), "p05_mm": low, "p95_mm": high,
            "min_mm": errors.min(), "max_mm": errors.max()}


def _line(label, d):
    if not d["n"]:
        return "%-42s none" % label
    return "%-42s mean %5.1f  sd %4.1f  5 %% %6.1f  95 %% %5.1f  min %6.1f  max %5.1f  (n = %d)" % (
        label, d["mean_mm"], d["sd_mm"], d["p05_mm"], d["p95_mm"], d["min_mm"], d["max_mm"], d["n"])


def main(argv):
    parser = command_line.Parser(prog="costmap_study", description=__doc__.splitlines()[0])
    options.add_episode_options(parser)
    parser.add_argument("--episodes", type=options.count(1, 100000), default=1, metavar="N")
    parser.add_argument("--seed", type=options.count(0, 2**31 - 1), default=1, metavar="K")
    command_line.add_output_options(parser)
    parser.set_defaults(policy="planner", detector="truth")
    args = parser.parse_args(argv)
    chosen = options.episode_options(args)
    clearances, jambs, outcomes = [], [], {}
    for seed in command_line.progress(range(args.seed, args.seed + args.episodes), args.episodes, "episodes"):
        run = episode.Episode(chosen, seed)
        if run.setup.start is None:
            continue
        study = Study(run)
        outcome = run.run(study.watch)["outcome"]
        outcomes[outcome] = outcomes.get(outcome, 0) + 1
        clearances += study.clearances
        jambs += study.jambs
    jambs = np.array(jambs).reshape(-1, 3)
    document = {"outcomes": outcomes, "clearance": describe(clearances), "stages": {}}
    lines = ["outcomes: " + ", ".join("%d %s" % (n, name) for name, n in sorted(outcomes.items())),
             "all in mm; positive: more room than there is", _line("clearance, nearer than 0.15 m",
                                                                   document["clearance"])]
    for name, low, high in STAGES:
        stage = jambs[(jambs[:, 0] >= low) & (jambs[:, 0] < high)]
        cells, surface = describe(stage[:, 1]), describe(stage[:, 2])
        document["stages"][name] = {"lethal_cells": cells, "surface": surface}
        lines += [_line(name + ": cells", cells), _line(name + ": surface", surface)]
    command_line.emit(document, args, "\n".join(lines))


if __name__ == "__main__":
    sys.exit(command_line.run(main))
