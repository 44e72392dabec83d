"""A study of the detector that is resumed knows which code made its results."""
import importlib.machinery
import importlib.util
import pickle
from types import SimpleNamespace

import pytest

from wheelchair_shared_control import parameters
from wheelchair_shared_control.experiments import code_version


@pytest.fixture(scope="module")
def benchmark():
    """The command line as a module."""
    try:
        path = str(parameters.package_file("scripts/detector_benchmark"))
    except parameters.ParameterError:
        pytest.skip("scripts/ is not installed")
    loader = importlib.machinery.SourceFileLoader("detector_benchmark_program", path)
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


def test_what_was_saved_is_there_again_with_the_code_that_made_it(benchmark, tmp_path):
    args = SimpleNamespace(state=str(tmp_path / "state"), seed=5, frames=1)
    assert benchmark._resumed(args) == ({}, set())
    benchmark._save(args, {5: "a", 6: "b"}, {"this", "another"})
    assert benchmark._resumed(args) == ({5: "a", 6: "b"}, {"this", "another"})
    with pytest.raises(benchmark.BenchmarkError, match="belongs to --seed 5 --frames 1"):
        benchmark._resumed(SimpleNamespace(state=args.state, seed=6, frames=1))


@pytest.mark.parametrize("content", [pickle.dumps(3), pickle.dumps(((5, 1), {})), b"no pickle", b""])
def test_another_file_is_refused(benchmark, tmp_path, content):
    path = tmp_path / "state"
    path.write_bytes(content)
    with pytest.raises(benchmark.BenchmarkError, match="is no study that could be resumed"):
        benchmark._resumed(SimpleNamespace(state=str(path), seed=5, frames=1))


def test_the_study_s_own_modules_count(benchmark):
    assert len({code_version.digest(), code_version.digest(benchmark.STUDY)}) == 2


@pytest.mark.parametrize("words", [["--seed", "-1"], ["--scenes", "0"]])
def test_numbers_outside_their_limits_are_refused(benchmark, words, capsys):
    with pytest.raises(SystemExit) as ended:
        benchmark.main(words)
    assert ended.value.code == 2 and capsys.readouterr().err.count("\n") == 1
