"""The paper's experiments as lists of episodes: who drives what, with which seeds; and their models.

All of them go through ``compare.Store``, so that a run that was ended goes on where it stopped.
"""
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control import bags, demonstration_recorder, demonstrations, parameters, teachers, training
from wheelchair_shared_control.experiments import compare, options
from wheelchair_shared_control.task_model import TaskModel

STRESS = ("hard_left", "hard_right")
USERS = STRESS + ("goal_directed",)
SCENES = options.SCENES
PAPER, RIVAL, RANGE, OURS = "learned variance", "distance", "learned variance, range shown", "learned confidence"
GUARDED, ALONE = "learned variance, guard on", "the user alone"
# as in the paper, nothing stands between the blend and the motors, except where the name says so
BASE = options.Options(guard=False)
POLICIES = {
    PAPER: {"policy": "learned_variance"},
    RIVAL: {"policy": "distance"},
    RANGE: {"policy": "learned_variance", "model": "full"},
    OURS: {"policy": "learned_confidence"},
    GUARDED: {"policy": "learned_variance", "guard": True},
    ALONE: {"policy": "user"},
}
SCALES = (1.0, 2.0, 3.0)  # the paper tried these and took the last
PAPERS_SCALE = 3.0
PER_SCENE = 6  # demonstrations of the paper, and of the shipped set
# Fig. 5 shows the crossing that begins on the door's axis, square to it
STRAIGHT = {"start_distance": (2.5, 2.5), "start_heading": (0.0, 0.0), "start_offset": (0.0, 0.0)}


class Extent(NamedTuple):
    """How much is driven: seeds a case of the policies, of the demonstrations; numbers of demonstrations a scene;
    components up to; parts of the set that are held out in turn (0: none)."""

    seeds: int
    demonstration_seeds: int
    per_scene: tuple
    components: int
    held_out: int


QUICK = Extent(1, 1, (1, 2, PER_SCENE), 6, 0)
FULL = Extent(10, 6, (1, 2, 4, PER_SCENE, 10), 8, 6)


def policies(seeds):
    """{name of ``POLICIES``: [(options, seed), ...]}: every user, scene and seed."""
    return {name: _cases(BASE._replace(**changes), USERS, seeds) for name, changes in POLICIES.items()}


def scales(seeds):
    """{sigma_scale: [(options, seed), ...]} of the paper's policy; the paper's own scale is the study above's."""
    chosen = BASE._replace(policy="learned_variance")
    return {
        scale: _cases(chosen if scale == PAPERS_SCALE else chosen._replace(sigma_scale=scale), USERS, seeds)
        for scale in SCALES
    }


def by_demonstrations(models, seeds):
    """{demonstrations a scene: [(options, seed), ...]} of the stress tests; ``models`` {number: model or None}."""
    chosen = BASE._replace(policy="learned_variance")
    return {number: _cases(chosen._replace(model=model), STRESS, seeds) for number, model in models.items()}


def stress_tests(scene, model=None):
    """Fig. 5: the options of hard left and hard right in a scene."""
    chosen = BASE._replace(policy="learned_variance", scene=scene, model=model, **STRAIGHT)
    return [chosen._replace(user=user) for user in STRESS]


def _cases(chosen, users, seeds):
    return [
        (chosen._replace(user=user, scene=scene), seed) for user in users for scene in SCENES for seed in seeds
    ]


def command(program, chosen, **more):
    """The command line that drives an episode of ``chosen``; ``more`` options in the order given."""
    words = ["rosrun wheelchair_shared_control", program]
    defaults = options.Options()
    for name, value in chosen._asdict().items():
        if value == getattr(defaults, name):
            continue
        option = "--" + name.replace("_", "-")
        if isinstance(value, bool):
            if name in ("guard", "detector"):
                value = ("on" if value else "off") if name == "guard" else ("on" if value else "truth")
            else:
                words.append(option)
                continue
        elif name == "camera":
            value = "%dx%d" % value
        elif isinstance(value, tuple):
            value = "%g" % value[0] if value[0] == value[1] else "%g:%g" % value
        elif isinstance(value, float):
            value = "%g" % value
        words += [option, str(value)]
    for name, value in more.items():
        words += ["--" + name.replace("_", "-"), str(value)]
    return " ".join(words)


# ---- models --------------------------------------------------------------------------------------------


def models_by_demonstrations(numbers, folder, progress=iter):
    """{demonstrations a scene: model file, None for the shipped model} for ``numbers``; files are made where missing.

    Up to the shipped six, the bags are those of the shipped set; more are recorded as those were.
    """
    folder, shipped = Path(folder), TaskModel.load("paper").training
    shown = {Path(entry["file"]).stem: (shipped.samples[shipped.bag_index == i], entry)
             for i, entry in enumerate(shipped.provenance["bags"])}
    result = {}
    for number in progress(numbers):
        if number == PER_SCENE:
            result[number] = None
            continue
        path = folder / ("demonstrations_%d.npz" % number)
        if not path.exists():
            for name, scene, index in _names(number):
                if name not in shown:
                    shown[name] = _recorded(name, scene, index, shipped.provenance["seed"], folder)
            folder.mkdir(parents=True, exist_ok=True)
            _trained([shown[name] for name, _, _ in _names(number)], shipped).save(path)
        result[number] = str(path)
    return result


def _names(number):
    return [("paper_%s_%d" % (scene, index + 1), scene, index) for scene in teachers.SCENES for index in range(number)]


def _recorded(name, scene, index, seed, folder):
    """Samples (n, 6) of one more teacher of the set ``paper``, and what the model's provenance says of the bag."""
    path = folder / "bags" / (name + ".bag")
    if not path.exists():
        demonstration_recorder.record("paper", scene, index, seed, path, parameters.load("teachers"))
    found = demonstrations.read(path, parameters.load("demonstrations"), demonstrations.topic_names())
    entry = {"file": path.name, "sha256": bags.sha256(path), "samples": len(found.samples), "source": found.source}
    return found.samples.astype(np.float32), entry


def _trained(shown, shipped):
    """Model of ``shown``, a list of (samples (n, 6), entry of the provenance)."""
    settings = parameters.load("training")
    samples = [part for part, _ in shown]
    together = np.concatenate(samples)
    bag_index = np.repeat(np.arange(len(samples)), [len(part) for part in samples])
    provenance = dict(shipped.provenance, made_by="wheelchair_shared_control reproduce",
                      bags=[entry for _, entry in shown])
    about = training.Training(together, bag_index, training.floors_of(settings), provenance)
    return training.fit(together.astype(float), settings.components, settings, shipped.provenance["seed"], about)


def components_study(up_to, held_out, progress=iter):
    """BIC by K of the shipped set, and the mean log likelihood of held-out samples by K where ``held_out`` > 0."""
    shipped = TaskModel.load("paper").training
    settings, samples = parameters.load("training"), shipped.samples.astype(float)
    seed, bic, likelihood = shipped.provenance["seed"], {}, {}
    for count in progress(range(1, up_to + 1)):
        model = training.fit(samples, count, training.in_short(settings), seed)
        bic[count] = float(training.bic(model, samples))
        if held_out:
            # bags are left out whole: the samples of one bag know each other
            groups = shipped.bag_index % held_out
            likelihood[count] = training.calibrate(samples, groups, count, settings, seed).log_likelihood
    return {"bic": bic, "log_likelihood": likelihood}


# ---- rows ----------------------------------------------------------------------------------------------


def rows_of(store, cases):
    """The rows of the store for [(options, seed), ...]."""
    return [store.rows[compare.key_of(*case)] for case in cases]
