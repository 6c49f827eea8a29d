"""Replays as files, from a server, and as a real browser shows them."""

import re
import shutil
import signal
import socket
import subprocess
import sys
import urllib.request

import matplotlib.image
import numpy as np
import pytest
from PIL import Image

import template_control as tc
from template_control.cli.main import main
from template_control.errors import RecordError
from template_control.view.replay.film import write_film
from template_control.view.replay.playback import playback


@pytest.fixture
def record(short_walk):
    return short_walk


@pytest.fixture(scope="module")
def run_file(short_walk, tmp_path_factory):
    return short_walk.save(tmp_path_factory.mktemp("replay") / "run.npz")


# Files.


def test_page_is_one_file_without_a_request(record, tmp_path):
    page = tc.save_html(record, tmp_path / "walk.html").read_text()
    assert "default-src 'none'" in page
    assert not re.search(r"<(script|link|img|iframe)[^>]*\b(src|href)=", page)
    assert "fetch(" not in page.split("</script>")[1]
    assert "five-link, gait walk, 4 steps" in page


def test_page_of_a_default_walk_is_small(record, tmp_path):
    """50 steps take 26.3 s; the page grows with the frames, and does not with the samples."""
    sizes = []
    for end in (1.0, 2.0):
        path = tc.save_html(record, tmp_path / "walk.html", end=end)
        sizes.append(path.stat().st_size)
    per_second = sizes[1] - sizes[0]
    assert sizes[0] + 25.3 * per_second < 10e6


@pytest.mark.slow(seconds=1)
def test_gif_shows_a_robot_that_moves(record, run_file, tmp_path, capfd):
    path = tmp_path / "walk.gif"
    part = ["--start", "0.5", "--end", "1", "--fps", "10"]
    assert main(["replay", str(run_file), "--gif", str(path), *part]) == 0
    assert "walk.gif" in capfd.readouterr().out
    film = Image.open(path)
    assert film.n_frames == 6
    pictures = []
    for frame in (0, 3):
        film.seek(frame)
        pictures.append(np.asarray(film.convert("RGB"), float))
    assert np.mean(np.abs(pictures[0] - pictures[1]).max(axis=2) > 40) > 0.01


@pytest.mark.slow(seconds=1)
def test_a_gif_is_its_last_seconds_by_default(record, tmp_path):
    film = Image.open(tc.save_film(record, tmp_path / "walk.gif", speed=0.2, fps=1.0))
    assert film.n_frames == 5


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="there is no ffmpeg here")
def test_video_has_its_frames(record, run_file, tmp_path):
    path = tmp_path / "walk.mp4"
    assert main(["replay", str(run_file), "--video", str(path), "--end", "0.5"]) == 0
    assert path.stat().st_size > 5000
    assert b"ftyp" in path.read_bytes()[:32]


def test_video_without_ffmpeg_is_one_line(record, tmp_path, monkeypatch):
    monkeypatch.setattr("matplotlib.animation.FFMpegWriter.isAvailable", lambda: False)
    with pytest.raises(RecordError, match=r"no ffmpeg here; install it, or write a \.gif"):
        tc.save_film(record, tmp_path / "walk.mp4")
    assert not (tmp_path / "walk.mp4").exists()


def test_a_gif_too_long_is_refused(record, tmp_path):
    frames = playback(record, fps=120.0, speed=0.05)
    with pytest.raises(RecordError, match="shorter part"):
        write_film(tmp_path / "walk.gif", frames, 120.0)


@pytest.mark.parametrize(
    ("arguments", "culprit"),
    [
        (["{tmp}/missing.npz"], "missing.npz"),
        (["{tmp}/junk.npz"], "junk.npz"),
        (["{run}", "--html", "/proc/none/walk.html"], "/proc/none/walk.html"),
        (["{run}", "--gif", "/proc/none/walk.gif"], "/proc/none/walk.gif"),
        (["{run}", "--gif", "walk.png"], "walk.png"),
        (["{run}", "--video", "walk.gif"], "walk.gif"),
        (["{run}", "--speed", "0"], "speed"),
        (["{run}", "--speed", "-1", "--html", "a.html"], "speed"),
        (["{run}", "--fps", "nan", "--gif", "a.gif"], "fps"),
        (["{run}", "--start", "50"], "start 50"),
    ],
)
def test_bad_input_is_one_line(arguments, culprit, run_file, tmp_path, monkeypatch, refused):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "junk.npz").write_text("junk")
    filled = [a.format(tmp=tmp_path, run=run_file) for a in arguments]
    line = refused(["replay", *filled])
    assert culprit in line


# Server and browser.


@pytest.mark.slow(seconds=1)
def test_the_server_serves_the_page_and_ends(record, tmp_path, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with tc.replay(record, end=0.3) as server:
        assert not server.open_browser()
        with urllib.request.urlopen(server.url, timeout=10) as answer:
            page = answer.read().decode()
    file = tc.save_html(record, tmp_path / "page.html", end=0.3).read_text()
    head = page.index("for (const text of")  # the objects' names are drawn anew
    assert (page[:head], len(page)) == (file[:head], len(file))
    assert "left foot: ground force, footholds" in page, "the page's legend"
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(server.url, timeout=10)


@pytest.mark.slow(seconds=3)
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_ends_a_replay_in_peace(run_file, how):
    command = [sys.executable, "-m", "template_control.cli.main", "replay", str(run_file)]
    process = subprocess.Popen(
        [*command, "--no-browser"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    line = process.stdout.readline()
    url = re.search(r"http://\S+/", line)
    assert url, line
    process.send_signal(how)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 0
    assert "Traceback" not in errors
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(url[0], timeout=10)


CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


def screenshot(url, path, profile):
    """What a headless browser without network shows; RGB in 0..1, and its console."""
    done = subprocess.run(
        [
            CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--use-gl=angle",
            "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic",
            "--no-first-run", "--disable-background-networking", "--disable-component-update",
            "--disable-sync", "--host-resolver-rules=MAP * ~NOTFOUND", "--enable-logging=stderr",
            f"--user-data-dir={profile}", "--window-size=900,600", "--hide-scrollbars",
            "--virtual-time-budget=3000", f"--screenshot={path}", url,
        ],
        capture_output=True,
        text=True,
        timeout=180,
    )  # fmt: skip
    assert path.is_file(), done.stderr[-2000:]
    console = [x for x in done.stderr.splitlines() if "CONSOLE" in x and "GL Driver" not in x]
    return matplotlib.image.imread(path)[..., :3], console


def coloured(picture, red, green, blue):
    """How many pixels have about this hue, whatever the light."""
    wanted = np.array([red, green, blue]) / np.linalg.norm([red, green, blue])
    size = np.linalg.norm(picture, axis=2)
    return int(np.sum((picture @ wanted > 0.985 * size) & (size > 0.3)))


@pytest.mark.slow(seconds=4)
@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium here")
def test_page_shows_a_walking_robot_in_a_browser_without_network(record, tmp_path):
    page = tc.save_html(record, tmp_path / "walk.html")
    pictures = []
    for i, time in enumerate((0.55, 0.8)):
        url = f"file://{page}?time={time}"
        picture, console = screenshot(url, tmp_path / f"{i}.png", tmp_path / f"profile{i}")
        assert not console
        pictures.append(picture[110:520, 250:650])  # between legend and controls
    for picture in pictures:
        # Both legs are seen, and the CoM with its trail.
        assert coloured(picture, 0.16, 0.38, 0.63) > 800
        assert coloured(picture, 0.86, 0.45, 0.13) > 800
        assert coloured(picture, 0.23, 0.60, 0.29) > 100
    moved = np.abs(pictures[0] - pictures[1]).max(axis=2) > 0.2
    assert moved.mean() > 0.02
    # The camera keeps the trunk in the middle while the legs move below it.
    upper, lower = np.array_split(moved, 2)
    assert lower.sum() > upper.sum()


@pytest.mark.slow(seconds=1)
def test_the_server_takes_the_port_it_is_given(record, tmp_path, refused):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        taken.listen()
        record.save(tmp_path / "run.npz")
        words = ["replay", str(tmp_path / "run.npz"), "--no-browser", "--port"]
        line = refused([*words, str(port)])
        assert f"does not start on port {port} (Address already in use): give another" in line
    with tc.replay(record, end=0.3, port=port) as server:
        assert f":{port}/" in server.url
        with urllib.request.urlopen(server.url, timeout=10) as answer:
            assert answer.status == 200
    assert "--port is 0: give a whole number from 1 to 65535" in refused([*words, "0"])


@pytest.mark.slow(seconds=3)
def test_a_walk_without_its_meshes_names_the_first_and_every_view_shows_it(tmp_path, capfd):
    text = tc.robot.robot_path("five-link").read_text()
    names = iter(f"meshes/part_{i}.stl" for i in range(99))
    text = re.sub(
        r"<visual>(.*?)<geometry>.*?</geometry>",
        lambda m: f'<visual>{m[1]}<geometry><mesh filename="{next(names)}"/></geometry>',
        text,
        flags=re.DOTALL,
    )
    path = tmp_path / "mine.urdf"
    path.write_text(text)
    words = ["walk", "--robot", str(path), "--steps", "1", "--output", str(tmp_path / "run")]
    assert main([*words, "--no-figures"]) == 0
    told = [line for line in capfd.readouterr().err.splitlines() if "meshes are missing" in line]
    assert len(told) == 1
    assert told[0].startswith(f"template-control: {path}: ")
    assert "the first is meshes/part_0.stl" in told[0]
    run, page = str(tmp_path / "run" / "run.npz"), tmp_path / "walk.html"
    assert main(["replay", run, "--html", str(page), "--gif", str(tmp_path / "walk.gif")]) == 0
    assert main(["plots", run]) == 0
    assert "walk again" not in capfd.readouterr().err
    assert page.stat().st_size > 1e5
