"""No kernel is compiled while the chair drives: what the nodes warm up is all that an episode uses."""
import sys

from numba.core.dispatcher import Dispatcher

from wheelchair_shared_control import doorway
from wheelchair_shared_control.experiments import graph, options
from wheelchair_shared_control.experiments.episode import Episode
from wheelchair_shared_control.planning.warm_up import warm_up
from wheelchair_shared_control.shared_control import SharedControl
from wheelchair_shared_control.simulation.simulator import Simulator
from wheelchair_shared_control.task_model import TaskModel

PACKAGE = "wheelchair_shared_control."
# the simulator's and the user's kernels may compile late: nobody sits on those
ON_THE_CHAIR = (
    "planning", "costmap", "distance_transform", "features", "guard", "rectangle", "sweep", "moving", "ranging", "gmr",
)


def signatures():
    """{kernel: compiled signatures} of all kernels that work on the chair.

    By the module that defines them: what two share (a heap) is compiled together with who calls it.
    """
    found = {}
    for name, module in list(sys.modules.items()):
        if not name.startswith(PACKAGE) or not name[len(PACKAGE):].startswith(ON_THE_CHAIR + ("doorway",)):
            continue
        for value in vars(module).values():
            if isinstance(value, Dispatcher) and value.py_func.__module__ == name:
                found[value.py_func.__module__ + "." + value.py_func.__name__] = tuple(value.signatures)
    return found


def test_an_episode_compiles_nothing_after_the_warm_up():
    chosen = options.Options(camera=options.CAMERAS["160x120"], start_offset=(0.4, 0.4), start_heading=(20.0, 20.0))
    episode = Episode(chosen, seed=2)
    settings = episode.settings
    warm_up(settings.navigation)
    doorway.warm_up(settings.detector)
    SharedControl(settings.blender).warm_up()
    TaskModel.load("paper").predict(1.0, 1.0, 1.0, 0.2)
    before = signatures()
    with Simulator(episode.world, settings.simulator, 2, episode.setup.start, chosen.camera) as simulator:
        loop = graph.Graph(chosen, episode.setup, 2, settings, simulator)
        while simulator.time < 8.0:
            loop.tick()
    assert loop.decision.status == "active"  # the planner did drive
    late = {name: kinds[len(before.get(name, ())):] for name, kinds in signatures().items()
            if len(kinds) > len(before.get(name, ()))}
    assert not late, "\n".join("%s %s" % item for item in sorted(late.items()))
