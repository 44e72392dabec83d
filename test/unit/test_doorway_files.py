"""Files for the detector: what is read, and what is refused in one line that names the file."""
import struct
import zlib

import numpy as np
import pytest

from wheelchair_shared_control import bag_writing, camera, doorway_files, parameters, ply
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
    "d.ply": (PLY.format(n=3, a="x", rows="1 2 3\n4 5 6"), "2 of the 3 points"),
    "e.ply": (PLY.format(n=2, a="x", rows="1 2 3\n4 5"), "1 of the 2 points"),
    "f.ply": (PLY.format(n=2, a="x", rows="1 2 3\n4 five 6"), "no three numbers"),
    "d.pcd": (PCD.format(fields="x y z", n=1, rows="1 2 3").replace("ascii", "nonsense"), "header is damaged"),
    "e.pcd": (PCD.format(fields="x y z", n=1, rows="1 2 3").replace("TYPE F", "TYPE Q"), "header is damaged"),
    "f.pcd": (PCD.format(fields="x y z", n=9, rows="1 2 3").replace("DATA", " DATA"), "of the 9 points"),
    "n" * 300 + ".ply": (None, "cannot be read"),
}


@pytest.mark.parametrize("name", sorted(BAD))
def test_what_is_no_cloud_is_refused_by_name(tmp_path, name):
    content, expected = BAD[name]
    path = tmp_path / name if content is None else write(tmp_path / name, content)
    with pytest.raises(FileError) as refusal:
        doorway_files.read(path)
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


def test_a_png_that_ends_early_is_refused(tmp_path):
    content = png16(np.arange(64 * 48, dtype=np.uint16).reshape(48, 64))
    garbled = content[:60] + bytes(20) + content[80:]
    for name, part in (("half.png", content[:len(content) // 2]), ("garbled.png", garbled)):
        (tmp_path / name).write_bytes(part)
        with pytest.raises(FileError, match=name + ": its data is damaged"):
            doorway_files.read(tmp_path / name)


POINTS = np.array([[1.5, -2.0, 0.25], [np.nan, 0.0, 3.0], [4.0, np.inf, 6.0]])


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("kind", ["f4", "f8"])
def test_binary_ply_of_either_byte_order_with_other_fields_and_elements(order, kind):
    # a camera of 4 + 1 bytes before the vertices, a normal and a colour among their fields, a face behind them
    table = np.zeros(3, np.dtype([("nx", order + "f4"), ("z", order + kind), ("red", "u1"), ("y", order + kind),
                                  ("x", order + kind)]))
    table["x"], table["y"], table["z"] = POINTS.T
    word = {"f4": "float", "f8": "double"}[kind]
    header = "ply\nformat binary_%s_endian 1.0\ncomment made here\nelement camera 1\nproperty float a\n" \
        "property uchar b\nelement vertex 3\nproperty float nx\nproperty %s z\nproperty uchar red\n" \
        "property %s y\nproperty %s x\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n" % (
            {"<": "little", ">": "big"}[order], word, word, word)
    content = header.encode() + bytes(5) + table.tobytes()
    assert np.array_equal(ply.points_of(content + b"\x01\x00\x00\x00\x00"), POINTS, equal_nan=True)
    with pytest.raises(ply.PlyError, match="2 of the 3 points"):
        ply.points_of(content[:-1])


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_text_ply_with_any_end_of_line_and_numbers_that_are_none(end):
    text = PLY.format(n=3, a="x", rows="1.5 -2 0.25\nnan 0 3\n4 inf 6").replace("\n", end)
    assert np.array_equal(ply.points_of(text.encode()), POINTS, equal_nan=True)


LENS = camera.Camera(64, 48, 58.9, 58.9, 31.5, 23.5)  # not the 52.5 pixels of a camera that nobody told


class LateInfo(bag_writing.BagWriter):
    """Notes the camera info after its image."""

    def write(self, topic, now, message):
        if topic.endswith("camera_info"):
            now += 0.01
        super().write(topic, now, message)


def test_an_image_of_a_bag_before_the_first_camera_info_has_that_camera(tmp_path):
    with LateInfo(tmp_path / "a.bag", parameters.load("wheelchair"), LENS) as bag:
        for now in (0.0, 0.6):
            bag.depth(now, np.full((48, 64), 2.0, np.float32))
    frames = doorway_files.read(tmp_path / "a.bag")
    assert [frame.camera.fx for frame in frames] == [58.9, 58.9]
    # what is given on the command line counts first
    given = doorway_files.read(tmp_path / "a.bag", Reading(intrinsics=(60.0, 60.0, 32.0, 24.0)))
    assert [frame.camera.fx for frame in given] == [60.0, 60.0]


class ColourBeside(bag_writing.BagWriter):
    """Notes a colour image, under a name that comes first, with every depth image."""

    def write(self, topic, now, message):
        if topic == "camera/depth/image_raw":
            colours = self.type("sensor_msgs", "Image")(message.header, 1, 1, "rgb8", 0, 3, np.zeros(3, np.uint8))
            super().write("camera/depth/color/image_raw", now, colours)
        super().write(topic, now, message)


def test_colours_under_a_name_of_depth_are_passed_over(tmp_path):
    with ColourBeside(tmp_path / "a.bag", parameters.load("wheelchair"), LENS) as bag:
        bag.depth(0.0, np.full((48, 64), 2.0, np.float32))
    (frame,) = doorway_files.read(tmp_path / "a.bag")
    assert frame.depth.shape == (48, 64) and frame.camera.fx == 58.9


def test_a_camera_info_of_another_size_is_refused_unless_intrinsics_are_given(tmp_path):
    with bag_writing.BagWriter(tmp_path / "a.bag", parameters.load("wheelchair"), LENS) as bag:
        bag.depth(0.0, np.full((96, 128), 2.0, np.float32))
    with pytest.raises(FileError, match="a.bag: camera/depth/image_raw is 128 x 96, its camera info 64 x 48"):
        doorway_files.read(tmp_path / "a.bag")
    (frame,) = doorway_files.read(tmp_path / "a.bag", Reading(intrinsics=(118.0, 118.0, 63.5, 47.5)))
    assert frame.camera.fx == 118.0
