"""Files for the detector: what is read, and what is refused in one line that names the file."""
import struct
import zlib

import numpy as np
import pytest

from wheelchair_shared_control import doorway_files
from wheelchair_shared_control.doorway_files import FileError, Reading

PCD = """# .PCD v0.7
VERSION 0.7
FIELDS {fields}
SIZE 4 4 4
TYPE F F F
COUNT 1 1 1
WIDTH {n}
HEIGHT 1
VIEWPOINT 1 2 3 1 0 0 0
POINTS {n}
DATA ascii
{rows}
"""
PLY = """ply
format ascii 1.0
element vertex {n}
property float {a}
property float y
property float z
end_header
{rows}
"""


def write(path, text):
    path.write_text(text)
    return path


def png16(image):
    """A PNG file of 16 bits and one channel."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    height, width = image.shape
    rows = b"".join(b"\x00" + row.astype(">u2").tobytes() for row in image)
    header = struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def test_a_pcd_keeps_its_viewpoint(tmp_path):
    path = write(tmp_path / "a.pcd", PCD.format(fields="x y z", n=2, rows="1 2 3\n4 5 6"))
    (frame,) = doorway_files.read(path)
    assert np.array_equal(frame.points, [[1, 2, 3], [4, 5, 6]])
    assert frame.origin == (1.0, 2.0, 3.0)


def test_a_ply_is_read(tmp_path):
    path = write(tmp_path / "a.ply", PLY.format(n=2, a="x", rows="1 2 3\n4 5 6"))
    (frame,) = doorway_files.read(path)
    assert np.array_equal(frame.points, [[1, 2, 3], [4, 5, 6]])


def test_an_empty_cloud_is_no_damage(tmp_path):
    (frame,) = doorway_files.read(write(tmp_path / "a.ply", PLY.format(n=0, a="x", rows="")))
    assert frame.points.shape == (0, 3)


BAD = {
    "a.pcd": (PCD.format(fields="x y intensity", n=1, rows="1 2 3"), "no field 'z'"),
    "b.pcd": ("not a cloud at all", "is no PCD file"),
    "c.pcd": (PCD.format(fields="x y z", n=9, rows="1 2 3"), "of the 9 points"),
    "a.ply": (PLY.format(n=1, a="w", rows="1 2 3"), "no field 'x'"),
    "b.ply": ("ply\nnonsense", "header"),
    "c.ply": ("hello", "is no PLY file"),
    "a.png": ("hello", "is no PNG file"),
    "a.npy": ("hello", "is no NumPy array"),
    "a.npz": ("hello", "is no NumPy array"),
    "a.xyz": ("1 2 3", "unknown kind of file"),
    "empty.ply": ("", "is empty"),
}


@pytest.mark.parametrize("name", sorted(BAD))
def test_what_is_no_cloud_is_refused_by_name(tmp_path, name):
    content, expected = BAD[name]
    with pytest.raises(FileError) as refusal:
        doorway_files.read(write(tmp_path / name, content))
    assert name in str(refusal.value) and expected in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_missing_file_is_refused_by_name(tmp_path):
    with pytest.raises(FileError, match="nowhere.ply: no such file"):
        doorway_files.read(tmp_path / "nowhere.ply")


def test_depth_in_millimetres_with_0_for_nothing(tmp_path):
    image = np.full((48, 64), 1500, np.uint16)
    image[0, 0] = 0
    path = tmp_path / "a.png"
    path.write_bytes(png16(image))
    (frame,) = doorway_files.read(path)
    assert frame.depth[1, 1] == pytest.approx(1.5) and np.isnan(frame.depth[0, 0])
    # 525 pixels at a width of 640
    assert frame.camera.fx == pytest.approx(52.5)


def test_the_turned_bits_of_sun_rgbd():
    raw = np.uint16((1500 << 3 | 1500 >> 13) & 0xFFFF)
    assert doorway_files.metres(np.array([[raw]]), Reading(format="sun"))[0, 0] == pytest.approx(1.5)


def test_the_scale_is_units_per_metre():
    assert doorway_files.metres(np.array([[5000]], np.uint16), Reading(scale=5000.0))[0, 0] == pytest.approx(1.0)


def test_arrays_are_points_or_depth(tmp_path):
    np.save(tmp_path / "points.npy", np.ones((7, 3)))
    np.savez(tmp_path / "depth.npz", depth=np.full((48, 64), 2.0, np.float32))
    assert doorway_files.read(tmp_path / "points.npy")[0].points.shape == (7, 3)
    assert doorway_files.read(tmp_path / "depth.npz", Reading(intrinsics=(60, 60, 32, 24)))[0].camera.fx == 60
