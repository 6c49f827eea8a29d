"""The page on which a robot is driven: its clock, its guard, and itself in a real browser."""

import http.client
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pinocchio as pin
import pytest
from chromium import CHROMIUM, NONE_HERE, Chromium, until

import template_control as tc
from template_control.errors import ParameterError
from template_control.view.live.pace import Pace
from template_control.view.live.page import Figures, Step, first_push
from template_control.view.live.scene import LiveScene
from template_control.view.live.server import PageServer, is_own
from template_control.view.replay.robot_visuals import foot_sides, load_shapes, model_of
from template_control.view.replay.scene import in_space

# Clock.


class Clock:
    """A time that passes only where somebody sleeps, or works."""

    def __init__(self):
        self.now = 10.0

    def sleep(self, seconds):
        self.now += seconds

    def pace(self, fps=30.0):
        return Pace(1e-3, fps, clock=lambda: self.now, sleep=self.sleep)


def test_as_many_ticks_as_time_go_by():
    clock = Clock()
    pace, ticks = clock.pace(), []
    for _ in range(90):
        ticks.append(pace.ticks())
        clock.sleep(0.01)
        pace.wait()
    assert set(ticks) == {33, 34}
    assert sum(ticks) == pytest.approx(3000, abs=1)
    assert clock.now == pytest.approx(13.0)
    pace.speed = 0.1
    assert sum(pace.ticks() for _ in range(90)) == pytest.approx(300, abs=1)


def test_frames_that_are_late_are_counted_and_long_halts_are_not_made_up_for():
    clock = Clock()
    pace = clock.pace()
    for work in (0.01, 0.06, 0.01, 0.01):
        clock.sleep(work)
        pace.wait()
    assert (pace.frames, pace.late) == (4, 1)
    assert pace.worst == pytest.approx(0.06 - 1.0 / 30.0)
    assert clock.now == pytest.approx(10.0 + 4.0 / 30.0)
    clock.sleep(2.0)
    pace.wait()
    before = clock.now
    pace.wait()
    assert clock.now == pytest.approx(before + 1.0 / 30.0)


# What is shown.


@pytest.mark.parametrize("floating", [False, True])
def test_a_frame_is_what_a_replay_shows(floating):
    robot = tc.load_floating_robot("bolt") if floating else tc.load_robot("five-link")
    with tc.run.LiveRun(tc.Experiment(robot)) as run:
        for tick in run:
            if tick.number == 150:
                break
        columns = run.recorder.latest(3)
        record = run.record()
    sides = foot_sides(model_of(record), record.feet)
    some, whole = in_space(record, sides, columns), in_space(record, sides)
    for of_some, of_whole in zip(some, whole, strict=True):
        np.testing.assert_array_equal(of_some, of_whole[-3:])
    np.testing.assert_array_equal(columns["q"], record.q[-3:])
    share, limit = np.abs(columns["torque"]).max(axis=0), record.torque_limit
    left, right, ground, template = Figures(record).of(columns)
    assert max(left, right) == pytest.approx(np.max(share / limit))
    assert ground == pytest.approx(columns["contact_force"][..., 1].sum() / 3.0 / record.weight)
    assert template == pytest.approx(columns["template_force"][..., 1].sum() / 3.0 / record.weight)


@pytest.mark.slow(seconds=1)
def test_joints_are_drawn_where_they_are_and_what_stands_still_is_not_sent_again():
    with tc.run.LiveRun(tc.Experiment(tc.load_floating_robot("bolt"))) as run:
        for tick in run:
            if tick.number == 150:
                break
        latest, record = run.recorder.latest(150), run.record()
    server = PageServer(None)
    try:
        scene = LiveScene(server.viser.scene, record, tc.Terrain.flat())
        to = [{k: v[: i + 1] for k, v in latest.items()} for i in (20, 149)]
        for columns in to:
            scene.draw(columns)
        model, _ = load_shapes(record)
        data = model.createData()
        pin.forwardKinematics(model, data, to[-1]["q"][-1])
        places = {0: pin.SE3.Identity()}
        for joint, drawn in enumerate(scene.joints, start=1):
            turn = pin.Quaternion(*np.asarray(drawn.node.wxyz)).matrix()
            places[joint] = places[model.parents[joint]] * pin.SE3(turn, drawn.node.position)
            assert pin.log6(places[joint].actInv(data.oMi[joint])).vector == pytest.approx(
                np.zeros(6), abs=2e-3
            )
        sent = []
        server.viser.scene._websock_interface.queue_message = sent.append
        for columns, moves in ((to[-1], False), (to[0], True)):
            scene.draw(columns)
            names = [getattr(message, "name", "") for message in sent]
            assert any(name.startswith("/world/robot/") for name in names) is moves
    finally:
        server.close()


def test_the_speed_is_that_of_the_last_step():
    step = Step(0, 0.0, None)
    with tc.run.LiveRun(tc.Experiment(steps=3)) as run:
        for tick in run:
            step = step.after(tick, run.recorder.latest(1))
        record = run.record()
    first, last = np.searchsorted(record.time, record.section_time[[2, 3]])
    moved = record.com[last, 0] - record.com[first, 0]
    assert step.speed == pytest.approx(moved / (record.time[last] - record.time[first]), rel=0.01)


def test_the_first_push_goes_with_the_robot():
    five_link, bolt = tc.load_robot("five-link"), tc.load_floating_robot("bolt")
    assert first_push(tc.template_for(five_link)) == 10.0
    assert 0.05 < first_push(tc.template_for(bolt)) < 0.1


# Server.


@pytest.mark.parametrize(
    ("host", "origin", "own"),
    [
        ("127.0.0.1:8080", "http://127.0.0.1:8080", True),
        ("localhost:9000", "http://localhost:9000", True),  # through a tunnel
        ("[::1]:8080", "http://[::1]:8080", True),
        ("127.0.0.1:8080", None, True),
        ("127.0.0.1:8080", "http://evil.example", False),
        ("127.0.0.1:8080", "http://127.0.0.1:3000", False),
        ("127.0.0.1:8080", "null", False),
        ("evil.example:8080", "http://evil.example:8080", False),  # a name that leads here
        ("evil.example:8080", None, False),
    ],
)
def test_only_the_page_itself_may_steer(host, origin, own):
    assert is_own(host, origin) is own


def test_the_server_refuses_foreign_pages_and_taken_ports():
    server = PageServer(None)
    try:
        port = int(re.search(r":(\d+)/", server.url)[1])
        own, foreign = f"http://127.0.0.1:{port}", "http://evil.example"
        for origins, status in ([foreign], 403), ([own, foreign], 403), ([own], 200):
            asked = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
            asked.putrequest("GET", "/")
            for origin in origins:
                asked.putheader("Origin", origin)
            asked.endheaders()
            assert asked.getresponse().status == status
            asked.close()
        with pytest.raises(ParameterError, match=rf"port {port} \(Address already in use\)"):
            PageServer(port)
    finally:
        server.close()


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["--port", "0"], "--port is 0: give a whole number from 1 to 65535"),
        (["--robot", "none"], "none"),
        (["--fps", "0"], "--fps"),
    ],
)
def test_bad_input_of_drive_is_one_line(words, why, refused):
    assert why in refused(["drive", "--no-browser", *words])


def test_an_experiment_with_a_motion_is_not_driven():
    with pytest.raises(ParameterError, match="the page is the robot's motion"):
        tc.view.drive(tc.Experiment(steps=3), wait=False)


# Browser.


def opens(tab, url, version):
    """Whether a page that is shown may open viser's socket."""
    return tab.value(
        f"""new Promise((done) => {{
          const socket = new WebSocket({url.replace("http", "ws")!r}, "viser-v{version}");
          socket.onopen = () => done(true);
          socket.onerror = () => done(false);
        }})"""
    )


@pytest.mark.slow(seconds=15)
@pytest.mark.skipif(CHROMIUM is None, reason=NONE_HERE)
def test_a_robot_is_driven_in_a_browser(tmp_path):
    import viser

    experiment = tc.Experiment(world=tc.PlantOptions())
    with (
        tc.view.drive(experiment, folder=tmp_path / "kept", wait=False) as page,
        Chromium(tmp_path) as browser,
    ):
        tab = browser.open(page.url)
        until(lambda: page.run is not None and page.tabs == 1, "the page is there")
        until(lambda: page.tick.time > 0.5, "the robot walks")
        before = tab.picture()
        # Slower, by the slider and by a key.
        until(lambda: "vertical force" in tab.text(), "all controls are there")
        first = page.run.hand.velocities[-1][1]
        tab.click(".mantine-Slider-track", across=0.25)
        until(lambda: page.run.hand.velocities[-1][1] < first - 0.2, "it is asked to be slower")
        second = page.run.hand.velocities[-1][1]
        tab.press("s")
        until(lambda: page.run.hand.velocities[-1][1] < second - 0.04, "and slower still")
        # A push, and what it does to the picture.
        tab.click("button", "ahead")
        until(lambda: page.run.hand.pushes, "it is pushed")
        until(lambda: page.step.speed < first - 0.2, "it is slower")
        changed = np.abs(tab.picture() - before).max(axis=2) > 0.1
        assert changed[:, : changed.shape[1] // 2].mean() > 0.01
        until(lambda: re.search(r"\d+ steps, 0\.\d\d m/s", tab.text()), "speed is on the page")
        # Halted by the key; a tick; a step.
        tab.press(" ")
        until(lambda: page.paused, "it is halted")
        until(lambda: "halted" in tab.text(), "the page says so")
        # A hint comes and goes, and the controls stay where they are.
        at = tab.place(".mantine-Slider-track")

        def late():
            page.pace.late += 100  # frames
            return "frames are late" in tab.text()

        until(late, "the page says that it is too slow")
        assert tab.place(".mantine-Slider-track") == at
        halted = page.tick
        tab.click("button", "tick")
        until(lambda: page.tick.number == halted.number + 1, "one tick is made")
        tab.click("button", "step")
        until(lambda: page.tick.steps == halted.steps + 1, "one step is made")
        # Another tab has the same page, and another origin none.
        other = browser.open(page.url)
        until(lambda: page.tabs == 2, "a second tab is there")
        until(lambda: "halted" in other.text(), "it shows the same run")
        other.press(" ")
        until(lambda: not page.paused, "the second tab may steer too")
        assert opens(other, page.url, viser.__version__)
        foreign = browser.open("data:text/html,<p>elsewhere</p>")
        assert not opens(foreign, page.url, viser.__version__)
        # On ice it falls, says why, and begins anew.
        page.run.hand.set_friction(0.02)
        until(lambda: page.run.ended, "it falls")
        until(lambda: "; reset begins anew" in tab.text(), "the page says so")
        notices = until(lambda: tab.text().count("Reset begins anew"), "and notifies")
        assert notices == 1, "once"
        (tmp_path / "kept").touch()
        tab.click("button", "save")
        until(lambda: "cannot write to" in tab.text(), "the page says so")
        (tmp_path / "kept").unlink()
        tab.click("button", "save")
        until(lambda: (tmp_path / "kept" / "run.toml").exists(), "it is saved")
        tab.click("button", "reset")
        until(lambda: not page.run.ended, "it begins anew")
        assert page.run.hand.friction == 0.7
        # Without a tab it waits.
        other.close()
        tab.close()
        until(lambda: page.tabs == 0, "the tabs are gone")
        time.sleep(0.2)
        stands = page.tick.number
        time.sleep(0.3)
        assert page.tick.number == stands
    record = tc.load_record(tmp_path / "kept" / "run.npz")
    again = tc.simulate(tc.Experiment.load(tmp_path / "kept" / "run.toml"))
    assert again.fall_reason == record.fall_reason
    np.testing.assert_array_equal(again.q[-len(record.q) :], record.q)


@pytest.mark.slow(seconds=4)
def test_ctrl_c_ends_a_drive_in_peace():
    command = [sys.executable, "-m", "template_control.cli.main", "drive", "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    line = process.stdout.readline()
    found = re.search(r"http://127\.0\.0\.1:(\d+)/", line)
    assert found, line
    asked = http.client.HTTPConnection("127.0.0.1", int(found[1]), timeout=10)
    asked.request("GET", "/")
    assert asked.getresponse().status == 200
    asked.close()
    process.send_signal(signal.SIGINT)
    out, errors = process.communicate(timeout=60)
    # Where the signal comes before Python has emptied what it has written, it writes that again.
    assert process.returncode == 0
    assert out in ("", line)
    assert "Traceback" not in errors
    with pytest.raises(OSError, match="refused"):
        http.client.HTTPConnection("127.0.0.1", int(found[1]), timeout=10).request("GET", "/")
