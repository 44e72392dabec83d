"""The page on policies, scenes and users of one's own does what it says: its files are run as they stand."""
import re
import subprocess
import sys

import pytest

from wheelchair_shared_control import blending, parameters
from wheelchair_shared_control.experiments import batch, compare, options
from wheelchair_shared_control.policy import PolicyResult

CLOSE = dict(start_distance=(1.8, 1.8), start_heading=(0.0, 0.0), start_offset=(0.0, 0.0))


@pytest.fixture
def files(tmp_path):
    """The page's files {name: path}; a file is a fenced block below a line that names it."""
    try:
        page = parameters.package_file("doc/own_policy.md").read_text(encoding="utf-8")
    except parameters.ParameterError:
        pytest.skip("doc/ is not installed")
    blocks = re.findall(r"^`([\w.]+)`:\n\n```\w+\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    for name, text in blocks:
        (tmp_path / name).write_text(text, encoding="utf-8")
    return {name: str(tmp_path / name) for name, _ in blocks}


def test_the_page_s_policy_is_short_and_crosses_in_the_page_s_scene_with_the_page_s_user(files):
    assert set(files) == {"steered.py", "store.yaml", "tired.yaml"}
    with open(files["steered.py"], encoding="utf-8") as stream:
        assert sum(bool(line.strip()) for line in stream) <= 20
    name = files["steered.py"] + ":steered"
    base = options.Options(detector=False, camera=options.CAMERAS["160x120"], **CLOSE)
    pairs = compare.plan(base, [name], ["move_base"], [files["tired.yaml"]], [files["store.yaml"]], [0.9], [5])
    rows = [compare.row_of(pair[0], result) for pair, result in zip(pairs, batch.run(pairs))]
    assert rows[0]["outcome"] == "crossed" and rows[0]["min_clearance_m"] > 0.0
    table = compare.markdown(compare.table(rows))
    assert "steered.py:steered" in table
    assert "steered.py:steered,move_base,tired.yaml,store.yaml" in compare.to_csv(rows)


def test_what_stands_beside_a_policy_can_be_imported_and_a_failure_names_its_line(tmp_path):
    (tmp_path / "beside_mine.py").write_text("HALF = 0.5\n", encoding="utf-8")
    mine = tmp_path / "mine_too.py"
    mine.write_text(
        "from __future__ import annotations\nfrom dataclasses import dataclass\nimport beside_mine\n\n\n@dataclass\n"
        "class Own:\n    share: float = beside_mine.HALF\n\n\ndef mine(tick, memory):\n    return Own().none\n",
        encoding="utf-8",
    )
    with pytest.raises(blending.PolicyError, match=r"AttributeError: .* \(mine_too.py, line 12\)"):
        blending.decided(blending.load_policy("%s:mine" % mine), None, {})
    other = tmp_path / "other"
    other.mkdir()
    (other / "beside_mine.py").write_text("HALF = 0.25\n", encoding="utf-8")
    (other / "third.py").write_text(
        "import beside_mine\n\n\ndef mine(tick, memory):\n    return (0, 0), beside_mine.HALF\n", encoding="utf-8")
    assert blending.decided(blending.load_policy("%s:mine" % (other / "third.py")), None, {}).beta == 0.25
    mine.write_text("import sys\nsys.exit(3)\n", encoding="utf-8")
    with pytest.raises(blending.PolicyError, match=r"SystemExit: 3 \(mine_too.py, line 2\)"):
        blending.load_policy("%s:mine" % mine)


@pytest.mark.parametrize("command", ["evaluate", "compare"])
def test_a_policy_that_fails_is_no_result(tmp_path, command):
    (tmp_path / "bad.py").write_text("def bad(tick, memory):\n    return 1 / 0\n", encoding="utf-8")
    name = "%s/bad.py:bad" % tmp_path
    words = ["--policies", name, "--output", str(tmp_path / "out")] if command == "compare" else ["--policy", name]
    words += ["--episodes", "1", "--camera", "160x120", "--detector", "truth"]
    words += ["--json-file", str(tmp_path / "out.json")]
    program = parameters.package_file("scripts/" + command)
    done = subprocess.run([sys.executable, str(program)] + words, capture_output=True, text=True, timeout=120)
    assert done.returncode == 1 and (tmp_path / "out.json").is_file()  # what was driven is written all the same
    assert "the policy failed in 1 of 1 episodes" in done.stderr
    assert "ZeroDivisionError: division by zero (bad.py, line 2)" in done.stderr and "Traceback" not in done.stderr


def test_the_page_s_policy_needs_a_planner_and_no_model_and_raises_in_one_line(files):
    name = files["steered.py"] + ":steered"
    assert blending.needs_planner(name) and not blending.needs_prediction(name)
    with pytest.raises(blending.PolicyError, match="policy raised AttributeError"):
        blending.decided(blending.load_policy(name), None, {})
    assert isinstance(blending.STICK_AT_REST, PolicyResult)
