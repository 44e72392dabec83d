"""The page on policies, scenes and users of one's own does what it says: its files are run as they stand."""
import re

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


def test_a_function_without_a_planner_s_command_waits_and_one_that_raises_ends_the_assistance(files):
    name = files["steered.py"] + ":steered"
    assert blending.needs_planner(name) and not blending.needs_prediction(name)
    with pytest.raises(blending.PolicyError, match="policy raised AttributeError"):
        blending.decided(blending.load_policy(name), None, {})
    assert isinstance(blending.STICK_AT_REST, PolicyResult)
