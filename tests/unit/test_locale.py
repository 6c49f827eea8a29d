"""Programs that write decimals with a comma, as those with Qt in it: numbers stay what they are."""

import json
import os
import shutil
import subprocess
import sys

import pytest

from template_control.robot.library import robot_path

NAME = "de_DE.UTF-8"
RUN = """
import ctypes, hashlib, json, locale, sys
import numpy as np
comma, path = sys.argv[1] == "comma", sys.argv[2]
if comma:
    locale.setlocale(locale.LC_ALL, "de_DE.UTF-8")
import template_control as tc
from template_control.robot import load_floating_robot
from template_control.plant.bullet import BulletPlant
from template_control.plant.mujoco import MujocoPlant

def points():
    buffer = ctypes.create_string_buffer(32)
    ctypes.CDLL(None).snprintf(buffer, 32, b"%.2f", ctypes.c_double(0.25))
    return buffer.value.decode()

found = {"before": points()}
robot = tc.load_robot(path)
found["robot"] = [robot.mass, robot.leg_length, robot.foot_radius, robot.urdf]
terrain = tc.Terrain.slope(np.radians(2.0))
worlds = tc.PlantOptions(terrain=terrain), tc.MujocoOptions(terrain=terrain), tc.IdealOptions()
for world in worlds:
    planner = tc.LqrPlanner(tc.default_gait(robot))
    record = tc.simulate(tc.Experiment(robot, planner=planner, steps=2, world=world))
    bits = hashlib.sha256(record.q.tobytes() + record.contact_force.tobytes()).hexdigest()
    found[world.kind] = [record.steps, bits]
free = load_floating_robot("bolt")
for plant in (
    BulletPlant(free, tc.PlantOptions()),
    MujocoPlant(free, tc.MujocoOptions()),
):
    q, v, force = free.neutral(), np.zeros(free.nv), np.zeros((2, 3))
    q[2], felt = 0.5, []
    plant.reset(q, v)
    for _ in range(400):
        plant.step(np.zeros(6))
        plant.read(q, v)
        plant.contact_forces(force)
        felt.append(np.concatenate([q, force.ravel()]))
    found["free " + type(plant).__name__] = hashlib.sha256(np.array(felt).tobytes()).hexdigest()
found["after"] = points()
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def locales(tmp_path_factory):
    """A folder with a locale of decimal commas, made of the system's own definitions."""
    folder = tmp_path_factory.mktemp("locales")
    tool = shutil.which("localedef")
    if tool is not None:
        call = [tool, "-i", "de_DE", "-f", "UTF-8", str(folder / NAME)]
        subprocess.run(call, capture_output=True, timeout=60)
    if not (folder / NAME).exists():
        pytest.skip("no localedef with the definition of de_DE here: it makes the comma's locale")
    return folder


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A robot of whole kilograms, whose masses do not tell that decimals are lost; with a mesh."""
    folder = tmp_path_factory.mktemp("urdf")
    (folder / "trunk.obj").write_text(
        "v -0.1 -0.1 0.05\nv 0.1 -0.1 0.05\nv 0.0 0.15 0.05\nv 0.0 0.0 0.55\n"
        "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
    )
    text = robot_path("five-link").read_text()
    for old, new in (("65.6", "66"), ("4.8", "5"), ("2.4", "2")):
        text = text.replace(f'<mass value="{old}"', f'<mass value="{new}"')
    mesh = '<collision><geometry><mesh filename="trunk.obj"/></geometry></collision>'
    path = folder / "robot.urdf"
    path.write_text(text.replace('<link name="trunk">', '<link name="trunk">' + mesh))
    return path


def result(locales, *arguments, program=RUN):
    environment = {**os.environ, "LOCPATH": str(locales)}
    call = [sys.executable, "-c", program, *map(str, arguments)]
    done = subprocess.run(call, capture_output=True, text=True, env=environment, timeout=300)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.slow(seconds=5)
def test_a_run_in_every_engine_has_the_same_bits_where_decimals_have_a_comma(locales, whole):
    point, comma = (result(locales, which, whole) for which in ("point", "comma"))
    assert (point.pop("before"), comma.pop("before")) == ("0.25", "0,25")
    assert (point.pop("after"), comma.pop("after")) == ("0.25", "0,25")
    assert point["pybullet"][0] == 2
    assert comma == point


THREADS = """
import ctypes, json, locale, threading
locale.setlocale(locale.LC_ALL, "de_DE.UTF-8")
from template_control.plant.c_library import decimal_points

def points():
    buffer = ctypes.create_string_buffer(32)
    ctypes.CDLL(None).snprintf(buffer, 32, b"%.2f", ctypes.c_double(0.25))
    return buffer.value.decode()

found = [points()]
with decimal_points():
    other = threading.Thread(target=lambda: found.append("other " + points()))
    other.start()
    other.join()
    with decimal_points():
        found.append(points())
    found.append(points())
found.append(points())
try:
    with decimal_points():
        raise OSError
except OSError:
    found.append(points())
print(json.dumps(found))
"""


def test_only_the_thread_that_asks_has_points_and_has_its_commas_back(locales):
    found = result(locales, program=THREADS)
    assert found == ["0,25", "other 0,25", "0.25", "0.25", "0,25", "0,25"]
