"""The comparison's folder: nothing is lost, nothing is driven twice, and its files read the same everywhere."""
import csv
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from wheelchair_shared_control import parameters
from wheelchair_shared_control.experiments import batch, code_version, compare, episode, options, referee, results

BASE = options.Options()


def row(policy="user", seed=1, outcome="crossed", share=0.5, **changes):
    """A row as ``compare.row_of`` makes it."""
    values = dict.fromkeys(compare.COLUMNS)
    values.update(policy=policy, planner="move_base", user="goal_directed", scene="open", door_width=0.9, door="door",
                  seed=seed, outcome=outcome, reason="", user_share_all=share, min_clearance_m=0.1, duration_s=10.0)
    values.update(changes)
    return values


def keys(folder):
    store = compare.Store(folder)
    store.close()
    return sorted(store.rows)


def test_what_was_added_is_there_again(tmp_path):
    store = compare.Store(tmp_path)
    for seed in (1, 2):
        store.add(compare.key_of(BASE, seed), row(seed=seed, share=1.0 / 3.0))
    store.close()
    again = compare.Store(tmp_path)
    assert again.rows == store.rows  # also the digits
    again.close()


@pytest.mark.parametrize("cut", range(1, 40, 6))
def test_a_line_that_was_cut_off_counts_as_not_driven(tmp_path, cut):
    store = compare.Store(tmp_path)
    for seed in (1, 2):
        store.add(compare.key_of(BASE, seed), row(seed=seed))
    store.close()
    path = tmp_path / compare.STORE
    path.write_bytes(path.read_bytes()[:-cut])  # killed in the middle of a line
    assert keys(tmp_path) == [compare.key_of(BASE, 1)]
    store = compare.Store(tmp_path)
    store.add(compare.key_of(BASE, 2), row(seed=2))
    store.close()
    assert keys(tmp_path) == sorted(compare.key_of(BASE, seed) for seed in (1, 2))


def test_what_other_code_made_is_driven_again(tmp_path):
    path = tmp_path / compare.STORE
    for seed, code in ((1, "another"), (2, None)):
        line = {"key": compare.key_of(BASE, seed), "row": row(seed=seed), "code": code}
        with open(str(path), "a") as stream:
            stream.write(json.dumps(line) + "\n")
    store = compare.Store(tmp_path)
    assert (store.rows, store.stale) == ({}, 2)
    store.add(compare.key_of(BASE, 1), row(seed=1, share=0.7))
    store.close()
    store = compare.Store(tmp_path)
    assert (len(store.rows), store.stale) == (1, 1)
    store.close()
    store = compare.Store(tmp_path, keep_stale=True)
    assert len(store.rows) == 2
    assert store.rows[compare.key_of(BASE, 1)]["user_share_all"] == 0.7  # the newer of the two
    store.close()


@pytest.mark.parametrize("code", ["another", code_version.digest()])
def test_a_row_from_before_a_column_was_added_lacks_that_value_only(tmp_path, code):
    old = row(share=0.7)
    del old["escape_m"]
    line = {"key": compare.key_of(BASE, 1), "row": old, "code": code}
    (tmp_path / compare.STORE).write_text(json.dumps(line) + "\n")
    store = compare.Store(tmp_path, keep_stale=True)
    found, = store.rows.values()
    store.close()
    assert (found["escape_m"], found["user_share_all"]) == (None, 0.7)
    assert "0.7" in compare.to_csv([found])


def test_the_table_tells_the_least_escape_of_all_standstills():
    rows = [row(seed=1, outcome="standstill", escape_m=0.73), row(seed=2, outcome="standstill", escape_m=0.21)]
    rows.append(row(seed=3))
    line, = compare.table(rows)
    assert line["least_escape_m"] == 0.21
    assert compare.table([row(seed=3)])[0]["least_escape_m"] is None
    assert "least escape [m]" in compare.report(rows)


def test_two_runs_do_not_write_into_one_folder(tmp_path):
    store = compare.Store(tmp_path)
    with pytest.raises(compare.CompareError, match="another run writes to it"):
        compare.Store(tmp_path)
    store.close()


def test_a_file_of_something_else_is_refused_by_its_line(tmp_path):
    (tmp_path / compare.STORE).write_text("no JSON\n", encoding="utf-8")
    with pytest.raises(compare.CompareError, match="line 1 is no finished episode"):
        compare.Store(tmp_path)


def test_the_csv_does_not_depend_on_the_order_of_driving():
    rows = [row(policy, seed, share=0.1 + 0.2) for policy in ("user", "distance") for seed in (10, 9, 100)]
    text = compare.to_csv(rows)
    assert text == compare.to_csv(rows[::-1])
    read = list(csv.DictReader(io.StringIO(text)))
    assert [(line["policy"], line["seed"]) for line in read] == [
        (policy, seed) for policy in ("distance", "user") for seed in ("9", "10", "100")
    ]
    assert {line["user_share_all"] for line in read} == {"0.3"}  # not 0.30000000000000004


def test_every_combination_is_planned_once_and_in_pairs():
    cases = compare.plan(BASE, ["user", "planner"], ["move_base"], ["goal_directed"], ["open", "hallway"],
                         [0.8, 0.9], range(3))
    assert len(cases) == len(set(cases)) == 2 * 2 * 2 * 3
    without = [
        {(chosen._replace(policy=""), seed) for chosen, seed in cases if chosen.policy == policy}
        for policy in ("user", "planner")
    ]
    assert without[0] == without[1]


def test_pairs_are_driven_beside_the_combinations():
    cases = compare.plan(BASE, ["planner"], ["move_base"], ["goal_directed"], ["open"], [0.9], [1],
                         [("planner", "bezier"), ("planner", "move_base")])
    assert [(chosen.policy, chosen.planner) for chosen, _ in cases] == [("planner", "move_base"), ("planner", "bezier")]


def test_doors_of_a_map_stand_for_scenes(tmp_path):
    path = tmp_path / "doors.yaml"
    door = (
        "- {name: %s, door_corner_pt_1: [0.0, 0.0], door_corner_pt_2: [0.9, 0.0],\n"
        "   approach: [{point: [0.45, -1.0, -1.57]}, {point: [0.45, 1.0, 1.57]}]}\n"
    )
    path.write_text(door % "a" + door % "b", encoding="utf-8")
    base = BASE._replace(map="map.yaml", doors=str(path), scene=None, door_width=None)
    cases = compare.plan(base, ["user"], ["move_base"], ["goal_directed"], ["open"], [0.9], [1, 2])
    assert [(chosen.door, chosen.side, seed) for chosen, seed in cases] == [
        (name, side, seed) for name in "ab" for side in (0, 1) for seed in (1, 2)
    ]
    assert episode.description(cases[0][0], 1)["scene"] in options.SCENES  # a text, though the map stands in its place


def test_differences_are_taken_in_pairs():
    # every episode of the one is 0.1 above the other's; the episodes themselves differ by far more
    rows = [row("a", seed, share=0.1 * seed + 0.1) for seed in range(8)]
    rows += [row("b", seed, share=0.1 * seed) for seed in range(9)]
    (value, low, high), pairs = compare.paired(
        rows, ("a", "move_base"), ("b", "move_base"), "user_share_all", np.random.default_rng(0)
    )
    assert pairs == 8  # seed 8 was driven by one alone
    assert value == pytest.approx(0.1)
    assert high - low < 1e-9


def test_the_table_leaves_out_what_could_not_start():
    rows = [row(seed=1), row(seed=2, outcome="contact"), row(seed=3, outcome="no_start", share=None)]
    line = compare.table(rows)[0]
    assert (line["n"], line["crossed"].value, line["contact"].value) == (2, 0.5, 0.5)
    assert "50.0" in compare.markdown([line])
    assert compare.report(rows).startswith("3 episodes (1 without a start: left out).")


def test_the_table_says_how_every_episode_ended():
    rows = [row(seed=seed, outcome=outcome) for seed, outcome in enumerate(referee.OUTCOMES) if outcome != "no_start"]
    line, (head, _, cells) = compare.table(rows)[0], compare.markdown(compare.table(rows)).splitlines()
    assert sum(line[outcome].value for outcome in referee.OUTCOMES if outcome != "no_start") == pytest.approx(1.0)
    for outcome in referee.OUTCOMES[:-1]:
        assert "| %s %%" % outcome in head
    assert cells.count("20.0 (") == 5


def test_the_summary_has_one_line_a_cell():
    rows = [row("a", 2, share=0.2), row("a", 1, share=0.4, outcome="contact"), row("b", 1, share=None),
            row("b", 2, outcome="no_start")]
    head, *lines = list(csv.reader(compare.summary_csv(rows).splitlines()))
    cells = [dict(zip(head, line)) for line in lines]
    assert [(cell["policy"], cell["n"], cell["crossed"], cell["contact"]) for cell in cells] == [
        ("a", "2", "1", "1"), ("b", "1", "1", "0")]
    assert [cell["user_share_all"] for cell in cells] == ["0.3", ""]
    assert compare.summary_csv(rows[::-1]) == compare.summary_csv(rows)


def test_doors_that_a_scene_s_file_gives_are_driven_once_and_told_by_their_own_width(tmp_path):
    path = tmp_path / "store.yaml"
    path.write_text("base: open\ndoor_width: 0.95\n", encoding="utf-8")
    cases = compare.plan(BASE, ["user"], ["move_base"], ["goal_directed"], [str(path), "open"], [0.8, 1.0], [1])
    assert [(chosen.scene, chosen.door_width) for chosen, _ in cases] == [
        (str(path), BASE.door_width), ("open", 0.8), ("open", 1.0)]
    chosen, seed = cases[0]
    run = episode.Episode(chosen, seed)
    result = results.not_driven(seed, referee.Verdict("no_start", ""), {"door_width_m": run.door.width})
    assert compare.row_of(chosen, result)["door_width"] == 0.95


def test_what_is_named_twice_is_driven_once():
    cases = compare.plan(BASE, ["user", "user"], ["move_base"], ["away", "away"], ["open", "open"], [0.9, 0.9], [1])
    assert len(cases) == 1


@pytest.mark.parametrize("option, place", [("policies", 1), ("users", 3), ("scenes", 4)])
def test_two_files_of_one_name_are_refused(option, place):
    given = [BASE, ["user"], ["move_base"], ["goal_directed"], ["open"], [0.9], [1]]
    given[place] = ["a/mine.yaml", "b/mine.yaml"]
    with pytest.raises(compare.CompareError, match="--%s: a/mine.yaml and b/mine.yaml would both" % option):
        compare.plan(*given)


@pytest.mark.parametrize("option", ["policy", "user", "scene", "model", "map", "doors"])
def test_an_edited_file_is_another_episode(tmp_path, option):
    path = tmp_path / "mine.yaml"
    chosen = BASE._replace(**{option: "%s:%s" % (path, "drive") if option == "policy" else str(path)})
    found = []
    for text in ("a: 1\n", "a: 2\n", "a: 1\n"):
        path.write_text(text, encoding="utf-8")
        code_version._of_file.cache_clear()  # as a new process does
        found.append(compare.key_of(chosen, 1))
    assert found[0] == found[2] != found[1]


def test_a_map_with_another_image_is_another_map(tmp_path):
    path, image = tmp_path / "map.yaml", tmp_path / "map.pgm"
    path.write_text("image: map.pgm\n", encoding="utf-8")
    found = []
    for content in (b"one", b"two"):
        image.write_bytes(content)
        code_version._of_file.cache_clear()
        found.append(compare.key_of(BASE._replace(map=str(path)), 1))
    assert found[0] != found[1]


def test_pairs_without_a_start_are_no_pairs():
    rows = [row(name, seed, outcome=outcome, touched=float(outcome == "contact")) for name in ("a", "b")
            for seed, outcome in ((1, "crossed"), (2, "no_start"))]
    _, pairs = compare.paired(rows, ("a", "move_base"), ("b", "move_base"), "touched", np.random.default_rng(0))
    assert pairs == 1


@pytest.mark.parametrize("words, told", [
    (["compare", "--users", "nobody"], "--user 'nobody' is unknown"),
    (["compare", "--policies", "nothing"], "--policy 'nothing' is unknown"),
    (["compare", "--dask", "here"], "no Dask scheduler at here"),
    (["evaluate", "--policy", "nothing"], "--policy 'nothing' is unknown"),
    (["tune", "--set", "minimax/comfort=[1"], "is not KEY=VALUE"),
])
def test_what_cannot_be_is_refused_in_one_line(tmp_path, words, told):
    try:
        program = parameters.package_file("scripts/" + words[0])
    except parameters.ParameterError:
        pytest.skip("scripts/ is not installed")
    more = ["--output", str(tmp_path)] if words[0] == "compare" else []
    done = subprocess.run([sys.executable, str(program)] + words[1:] + more, stderr=subprocess.PIPE, text=True)
    assert done.returncode == (1 if "--dask" in words else 2)
    assert told in done.stderr and done.stderr.count("\n") == 1


def test_a_worker_with_other_code_is_refused(monkeypatch):
    there = batch._one(BASE, 1, "another")
    assert "a worker runs other code" in there  # and nothing was driven
    monkeypatch.setattr(batch.episode, "run", lambda options, seed: {"seed": seed})
    assert batch.run([(BASE, 1), (BASE, 2)]) == [{"seed": 1}, {"seed": 2}]


def test_processes_of_an_installed_workspace_agree_on_the_code():
    """In catkin's devel space the package that is imported first is a stand-in, in a worker process it is not."""
    program = (
        "from joblib import Parallel, delayed\n"
        "from wheelchair_shared_control.experiments import code_version\n"
        "print(code_version.digest(), *Parallel(2)(delayed(code_version.digest)() for _ in range(2)))\n"
    )
    env = dict(os.environ)
    env["PYTHONPATH"] = env.get("PYTHONPATH") or str(Path(code_version.__file__).resolve().parents[2])
    found = subprocess.run([sys.executable, "-c", program], env=env, capture_output=True, text=True, timeout=120)
    assert set(found.stdout.split()) == {code_version.digest()}, found.stderr
