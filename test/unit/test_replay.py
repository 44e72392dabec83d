"""An episode seen again: the film and the bag show it, and looking on changes nothing."""
import numpy as np
import pytest
from PIL import Image

from wheelchair_shared_control import bags
from wheelchair_shared_control.command_line import OutputError, to_json
from wheelchair_shared_control.experiments import episode, episode_bag, figures, film, options

CHOSEN = options.Options(
    detector=False, camera=options.CAMERAS["160x120"], scene="right_wall", user="hard_right",
    start_distance=(1.6, 1.6), start_heading=(0.0, 0.0), start_offset=(0.0, 0.0),
)
SEED = 4


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """The result, and the paths of film and bag."""
    folder = tmp_path_factory.mktemp("replay")
    run = episode.Episode(CHOSEN, SEED)
    taken = film.Film(run)
    with episode_bag.EpisodeBag(folder / "episode.bag", run) as bag:

        def watch(graph, simulator):
            taken.watch(graph, simulator)
            bag.watch(graph, simulator)

        result = run.run(watch)
    taken.save(folder / "film.gif")
    return result, run, folder


def test_looking_on_changes_nothing(recorded):
    result, _, _ = recorded
    assert to_json(episode.run(CHOSEN, SEED)) == to_json(result)


def test_the_film_lasts_as_long_as_the_episode(recorded):
    result, _, folder = recorded
    with Image.open(str(folder / "film.gif")) as picture:
        shown = 0
        for frame in range(picture.n_frames):
            picture.seek(frame)
            shown += picture.info["duration"]
    # 10 frames a second, and one second of the end; equal frames are merged, their time is kept
    assert shown / 1000.0 == pytest.approx(result["duration_s"] + 1.0, abs=0.25)


def test_the_bag_holds_what_the_blender_decided(recorded):
    _, run, folder = recorded
    with bags.open_bag(folder / "episode.bag") as bag:
        states = [message for _, _, _, message in bag.messages(["blender/state"])]
        costmaps = sum(1 for _ in bag.messages(["move_base/local_costmap/costmap"]))
        for topic in ("tf", "tf_static", "odom", "camera/depth/image_raw", "blender/markers", "simulator/world",
                      "doorway_detector/markers", "assistance", "joint_states", "move_base/local_plan"):
            assert topic in bag.topics
    assert len(states) == len(run.log.time)
    beta = np.array([state.beta for state in states])
    assert np.array_equal(beta, run.log.beta, equal_nan=True)
    assert costmaps == pytest.approx(10.0 * run.log.time[-1], abs=2.0)  # 10 Hz


def test_the_figure_shows_the_whole_track_and_warns_of_nothing(recorded, tmp_path, caplog):
    _, run, _ = recorded
    figure = figures.crossing(run.log, run.world, run.door, run.footprint, "a title")
    figures.save(figure, tmp_path / "crossing.png")
    assert not caplog.records
    view = figure.axes[0]
    for span, place in ((view.get_xlim(), run.log.truth[:, 0]), (view.get_ylim(), run.log.truth[:, 1])):
        assert span[0] < place.min() - 0.9 and place.max() + 0.9 < span[1]


def test_no_bag_is_left_where_the_episode_failed(tmp_path):
    run = episode.Episode(CHOSEN, SEED)

    def stop(graph, simulator):
        bag.watch(graph, simulator)
        raise RuntimeError("in the middle")

    with pytest.raises(RuntimeError):
        with episode_bag.EpisodeBag(tmp_path / "episode.bag", run) as bag:
            run.run(stop)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["film.avi", "film"])
def test_an_unknown_kind_of_film_is_refused(name):
    with pytest.raises(OutputError, match="must end in .gif or .mp4"):
        film.check(name)


def test_ros_own_library_reads_the_bag(recorded):
    rosbag = pytest.importorskip("rosbag", reason="ROS's rosbag is not installed")
    _, _, folder = recorded
    with rosbag.Bag(str(folder / "episode.bag")) as bag:
        assert sum(1 for _ in bag.read_messages(raw=True)) == bag.get_message_count() > 1000
