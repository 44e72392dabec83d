"""The model's file: what comes back, and what is refused."""
import io
import json
import os
import zipfile

import numpy as np
import pytest

from wheelchair_shared_control.task_model import TaskModel, TaskModelError, Training
from wheelchair_shared_control.task_model_file import ENTRIES


@pytest.fixture
def model():
    rng = np.random.default_rng(0)
    samples = rng.uniform(0, 2, (100, 6)).astype(np.float32)
    provenance = {"bags": [{"file": "a.bag", "sha256": "00"}], "seed": 3}
    training = Training(samples, np.zeros(100, int), np.full(6, 0.01), provenance)
    return TaskModel([0.4, 0.6], rng.normal(size=(2, 6)), [np.eye(6), 2 * np.eye(6)], training=training)


@pytest.fixture
def path(model, tmp_path):
    model.save(tmp_path / "model.npz")
    return tmp_path / "model.npz"


def rewrite(path, **entries):
    """Replace, add or (None) remove entries of a model file."""
    with np.load(str(path)) as archive:
        arrays = dict(archive)
    arrays.update(entries)
    np.savez(str(path), **{name: array for name, array in arrays.items() if array is not None})


def rewrite_header(path, **changes):
    with np.load(str(path)) as archive:
        header = json.loads(str(archive["header"]))
    header.update(changes)
    rewrite(path, header=np.array(json.dumps({key: value for key, value in header.items() if value is not None})))


def refused(path, message):
    with pytest.raises(TaskModelError, match=message) as caught:
        TaskModel.load(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_all_comes_back(model, path):
    loaded = TaskModel.load(path)
    assert loaded.predict(1, 1, 1, 0.3) == model.predict(1, 1, 1, 0.3)
    assert loaded.density_quantiles == model.density_quantiles
    assert (loaded.training.samples == model.training.samples).all()
    assert loaded.training.provenance == model.training.provenance
    assert TaskModel.load(path, "total").variance == "total"


def test_equal_models_are_equal_files(model, path, tmp_path):
    TaskModel.load(path).save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == path.read_bytes()


def test_what_was_shown_and_what_was_not(model):
    # log densities of the training set: 5 % of the samples lie below the 5 % quantile
    middle = model.training.samples[:, :4].mean(axis=0)
    assert model.seen(*middle) and not model.seen(60, 60, 60, 9)
    assert model.density_rank(model.density_quantiles[0.05]) == pytest.approx(0.05, abs=0.01)
    assert model.density_rank(-1e9) == 0.0


def test_unknown_version_is_refused(path):
    rewrite_header(path, version=2)
    refused(path, "version 2: this package reads version 1")


@pytest.mark.parametrize(
    "change, message",
    [
        (dict(format="other"), "no task model"), (dict(names=["a"] * 6), "features"),
        (dict(units=["m"] * 6), "features"),
        (dict(extra=1), "unknown 'extra'"), (dict(provenance=None), "without 'provenance'"),
        (dict(components=3), "holds 2"), (dict(provenance=[]), "provenance"),
        (dict(version=True), "version True"), (dict(version=1.0), "version 1.0"), (dict(version="1"), "version '1'"),
        (dict(provenance={"bags": "a.bag"}), "no list of entries"),
        (dict(provenance={"bags": [{"file": "a.bag"}]}), "bag without file and sha256"),
        (dict(provenance={"bags": [{"file": "a.bag", "sha256": [0]}]}), "bag without file and sha256"),
        (dict(provenance={}), "names 0 bags"),
    ],
)
def test_other_headers_are_refused(path, change, message):
    rewrite_header(path, **change)
    refused(path, message)


@pytest.mark.parametrize("name", sorted(ENTRIES))
def test_missing_entries_are_refused(path, name):
    rewrite(path, **{name: None})
    refused(path, "'%s' is missing" % name)


@pytest.mark.parametrize(
    "entries, message",
    [
        (dict(code=np.zeros(1)), "'code.npy' is unknown"),
        (dict(weights=np.array([0.4, 0.7])), "sum to"),
        (dict(weights=np.array(["a", "b"])), "entry 'weights'"),
        (dict(means=np.zeros((2, 7))), "entry 'means'"),
        (dict(means=np.full((2, 6), np.nan)), "not finite"),
        (dict(covariances=np.zeros((2, 6, 6))), "symmetric|positive"),
        (dict(covariances=np.stack([np.eye(6), -np.eye(6)])), "not positive definite"),
        (dict(covariances=np.full((2, 6, 6), np.nan)), "covariances are not finite"),
        (dict(bag_index=np.zeros(3, int)), "indices"),
        (dict(floors=np.full(6, -1.0)), "negative"),
        (dict(bag_index=np.full(100, 1)), "bag 1 to 1 and names 1 bags"),
        (dict(bag_index=np.full(100, -1)), "bag -1 to -1"),
        (dict(weights=np.array([0.4, 0.6], np.float16)), "entry 'weights' is float16"),
        (dict(header=np.array("{")), "damaged header"),
        (dict(header=np.array("[" * 100000)), "damaged header"),
    ],
)
def test_wrong_entries_are_refused(path, entries, message):
    rewrite(path, **entries)
    refused(path, message)


def test_pickled_objects_are_never_loaded(path):
    class Trap:
        def __reduce__(self):
            return (pytest.fail, ("a model file has run code",))

    rewrite(path, samples=np.array([Trap()], dtype=object))
    refused(path, "no task model|entry 'samples'")


def test_damaged_bytes_are_refused(path):
    content = bytearray(path.read_bytes())
    for damage in (content[: len(content) // 2], b"", b"PK\x05\x06" + bytes(18), bytes(100), b"not a model"):
        path.write_bytes(bytes(damage))
        refused(path, "no task model|damaged|missing")
    rng = np.random.default_rng(1)
    for _ in range(100):
        broken = content.copy()
        for place in rng.integers(len(broken), size=20):
            broken[place] ^= 0xFF
        path.write_bytes(bytes(broken))
        try:
            TaskModel.load(path)  # the damage may hit what is not read
        except TaskModelError as error:
            assert "\n" not in str(error)


def test_a_bomb_is_refused(path):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("weights.npy", bytes(60 * 10**6))
    path.write_bytes(packed.getvalue())
    refused(path, "unpacks to 60 MB")


def test_missing_files_and_directories_are_refused(tmp_path):
    refused(tmp_path / "none.npz", "cannot be read: No such file")
    refused(tmp_path, "directory")
    os.mkfifo(str(tmp_path / "pipe"))  # opening it would wait for ever
    refused(tmp_path / "pipe", "no regular file")
