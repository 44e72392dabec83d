"""An episode as a film: from above, and as the chair's camera sees it, with who steers."""
import io
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from wheelchair_shared_control import command_line, se2
from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control.command_line import OutputError
from wheelchair_shared_control.guard import FREE, SLOWED, STOPPED
from wheelchair_shared_control.simulation import outlines

RATE = 10  # frames a second: the camera's
SMOOTH = 2  # the view from above is drawn this much larger, then made smaller
VIEW, SIDE, HEIGHT = 480, 280, 360  # px: the two columns, and their height
MARGIN = 10  # px
BACKGROUND, WALL, INK, FAINT = (255, 255, 255), (107, 107, 107), (44, 44, 44), (200, 200, 200)
USER, PLANNER, SENT, PERSON = (59, 111, 182), (217, 130, 43), (44, 44, 44), (217, 102, 38)
GUARD = {SLOWED: ((230, 170, 20), "guard slows"), STOPPED: ((200, 40, 30), "guard stops")}
HORIZON = 1.2  # s: an arrow shows where a command leads in this time
NEAREST, FURTHEST = 0.5, 4.5  # m: colours of the depth image
SUFFIXES = (".gif", ".mp4")
COLOURS = 128  # of a GIF


def check(path):
    """Refuse a film's file name before anything is driven. Raises OutputError."""
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise OutputError("--video %s: must end in %s" % (path, " or ".join(SUFFIXES)))
    if suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise OutputError("--video %s: .mp4 needs ffmpeg on the path (apt-get install ffmpeg); .gif does not" % path)


class Film:
    """Collects frames: ``watch`` is what ``Episode.run`` calls after every tick of the blender; then ``save``."""

    def __init__(self, episode):
        self._door_from_world = se2.inverse(episode.door.pose)
        self._footprint = episode.footprint
        self._speed_limit = episode.settings.navigation.wheelchair.limits.speed
        start = se2.compose(self._door_from_world, episode.setup.start)
        across = max(1.7, abs(start[1]) + 0.9)
        self._scale = min(VIEW / (2.8 - start[0] + 0.7), HEIGHT / (2.0 * across))  # px/m
        self._middle = 0.5 * (2.8 + start[0] - 0.7)
        chosen = episode.options
        place = episode.door.name if chosen.map else chosen.scene.rpartition("/")[2]
        names = (chosen.policy.rpartition("/")[2], chosen.user.rpartition("/")[2], place, episode.seed)
        self._title = "%s, %s, %s, seed %d" % names
        self._background = self._drawn_world(episode.world)
        self._font, self._small = ImageFont.load_default(15), ImageFont.load_default(12)
        self._palette = (matplotlib.colormaps["viridis"](np.linspace(0.0, 1.0, 256))[:, :3] * 255).astype(np.uint8)
        self._track, self._next, self.frames = [], 0.0, []

    def watch(self, graph, simulator):
        """Take a frame where one is due."""
        pose = se2.compose(self._door_from_world, simulator.truth().pose)
        self._track.append(pose)
        if graph.state.stamp < self._next - 1e-9:
            return
        self._next += 1.0 / RATE
        self.frames.append(self._frame(graph, simulator, pose))

    def save(self, path):
        """Write the film, wholly or not at all. Raises OutputError."""
        check(path)
        if not self.frames:
            raise OutputError("%s: not written: nothing was driven" % path)
        # the end stays for a moment
        frames = self.frames + [self.frames[-1]] * RATE
        write = _save_gif if Path(path).suffix.lower() == ".gif" else _save_mp4
        write(frames, Path(path))

    # ---- drawing ---------------------------------------------------------------------------------------

    def _pixels(self, points):
        """Pixels of the enlarged view from above for points (n, 2) [m] in the door's frame; along it is right."""
        points = np.atleast_2d(points)
        scale = SMOOTH * self._scale
        x = SMOOTH * VIEW / 2.0 + (points[:, 0] - self._middle) * scale
        y = SMOOTH * HEIGHT / 2.0 - points[:, 1] * scale
        return [tuple(pair) for pair in np.column_stack((x, y)).tolist()]

    def _drawn_world(self, world):
        image = Image.new("RGB", (SMOOTH * VIEW, SMOOTH * HEIGHT), BACKGROUND)
        draw = ImageDraw.Draw(image)
        shapes = outlines.from_world(world)
        for corners, count in zip(shapes.vertices, shapes.counts):
            outline = se2.transform_points(self._door_from_world, corners[:count])
            draw.polygon(self._pixels(outline), fill=WALL)
        return image

    def _frame(self, graph, simulator, pose):
        state = graph.state
        view = self._background.copy()
        draw = ImageDraw.Draw(view)
        if len(self._track) > 1:
            draw.line(self._pixels(np.array(self._track)[:, :2]), fill=FAINT, width=2 * SMOOTH)
        if simulator.person is not None:
            body = outlines.from_boxes(simulator.person.box(simulator.time)[None])[0, :4]
            draw.polygon(self._pixels(se2.transform_points(self._door_from_world, body)), fill=PERSON)
        draw.polygon(self._pixels(footprints.corners(self._footprint, pose)), outline=INK, fill=(226, 233, 243),
                     width=2 * SMOOTH)
        for command, colour, width in ((state.planner, PLANNER, 3), (state.user, USER, 3), (state.sent, SENT, 2)):
            if command is not None and np.isfinite(command).all():
                self._arc(draw, pose, command, colour, width)
        canvas = Image.new("RGB", (VIEW + SIDE + 3 * MARGIN, HEIGHT + 2 * MARGIN), BACKGROUND)
        canvas.paste(view.resize((VIEW, HEIGHT), Image.LANCZOS), (MARGIN, MARGIN))
        self._side(canvas, graph.depth.image, state)
        return canvas

    def _arc(self, draw, pose, command, colour, width):
        """Where the middle of the front edge would go under a command."""
        times = np.linspace(0.0, HORIZON, 13)
        poses = np.array([se2.integrate(pose, command[0], command[1], time) for time in times])
        front = np.column_stack((np.full(1, self._footprint.front), np.zeros(1)))
        line = self._pixels(np.vstack([se2.transform_points(at, front) for at in poses]))
        draw.line(line, fill=colour, width=width * SMOOTH, joint="curve")
        x, y = line[-1]
        radius = (width + 1) * SMOOTH
        draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=colour)

    def _side(self, canvas, depth, state):
        left, draw = VIEW + 2 * MARGIN, ImageDraw.Draw(canvas)
        canvas.paste(self._coloured(depth), (left, MARGIN))
        y = MARGIN + SIDE * 3 // 4 + 8
        draw.text((left, y), self._title, fill=INK, font=self._small)
        y += 20
        draw.text((left, y), "%4.1f s" % state.stamp, fill=INK, font=self._font)
        if state.guard != FREE:
            colour, text = GUARD.get(state.guard, (INK, "guard"))
            draw.text((left + 70, y), text, fill=colour, font=self._font)
        elif not state.assisting:
            draw.text((left + 70, y), "the user drives alone", fill=INK, font=self._font)
        y += 24
        beta = state.beta if state.assisting and state.beta is not None and np.isfinite(state.beta) else None
        draw.rectangle((left, y, left + SIDE, y + 14), fill=FAINT if beta is None else PLANNER)
        if beta is not None:
            draw.rectangle((left, y, left + int(SIDE * beta), y + 14), fill=USER)
        y += 18
        words = (("user", USER), ("planner", PLANNER), ("sent", SENT))
        for index, (word, colour) in enumerate(words):
            draw.text((left + index * 90, y), word, fill=colour, font=self._font)
        if beta is not None:
            draw.text((left + 225, y), "%3.0f %%" % (100.0 * beta), fill=USER, font=self._font)

    def _coloured(self, depth):
        """A depth image (height, width) [m] in colours, near is dark; what was not measured is white."""
        height = SIDE * 3 // 4
        rows = np.arange(height) * depth.shape[0] // height
        columns = np.arange(SIDE) * depth.shape[1] // SIDE
        small = depth[np.ix_(rows, columns)]
        seen = np.isfinite(small)
        level = np.clip((np.where(seen, small, NEAREST) - NEAREST) / (FURTHEST - NEAREST), 0.0, 1.0)
        # few shades: the sensor's noise would fill the file otherwise
        shades = self._palette[(level * 15).round().astype(int) * 17]
        shades[~seen] = 255
        return Image.fromarray(shades)


def _save_gif(frames, path):
    # one palette for all frames, so that what stands still stays the same
    palette = frames[len(frames) // 2].quantize(COLOURS)
    small = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    content = io.BytesIO()
    small[0].save(
        content, format="GIF", save_all=True, append_images=small[1:], duration=1000 // RATE, loop=0, optimize=False
    )
    command_line.write_atomically(path, content.getvalue())


def _save_mp4(frames, path):
    width, height = (size // 2 * 2 for size in frames[0].size)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=str(path.parent), prefix="." + path.stem, suffix=".mp4")
        os.close(handle)
    except OSError as error:
        raise OutputError("%s: cannot be written: %s" % (path, error.strerror))
    command = [
        "ffmpeg", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", "%dx%d" % (width, height),
        "-r", str(RATE), "-i", "-", "-pix_fmt", "yuv420p", temporary,
    ]
    content = b"".join(frame.crop((0, 0, width, height)).tobytes() for frame in frames)
    done = subprocess.run(command, input=content, stderr=subprocess.PIPE, check=False)
    if done.returncode:
        os.unlink(temporary)
        raise OutputError("%s: ffmpeg: %s" % (path, done.stderr.decode("utf-8", "replace").strip().split("\n")[-1]))
    os.replace(temporary, str(path))
