"""The OpenGL peer as a whole: whether it is there, which one, its threads, stages and limits."""

import json
import os
import subprocess
import sys
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import numpy as np
import pytest
from builders import square
from opengl_peer import METHODS, needs_opengl, opengl
from small_runs import carry_out, planned
from surfaces import receivers_at, scattered_receivers, soup, world_of
from tracing import shaded

from shadowbench.methods.opengl import peer
from shadowbench.methods.opengl import probe as module
from shadowbench.methods.opengl.probe import Found, probe
from shadowbench.rows import Outcome
from shadowbench.scene import DirectionalLight, PointLight, RectangularLight

LIGHTS = {"sun": DirectionalLight((0.4, 1.0, 0.3)), "lamp": PointLight((0.2, 0.9, 0.1))}
NO_EGL = "libNobodyHasIt.so"


@pytest.fixture
def asked_anew():
    """Whatever is found in a test is forgotten after it."""
    probe.cache_clear()
    yield
    probe.cache_clear()


@pytest.mark.usefixtures("asked_anew")
@pytest.mark.parametrize(
    ("child", "reason"),
    [
        ("import os; os.abort()", "trying it ends by SIGABRT"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "trying it ends by SIGSEGV"),
        ("raise RuntimeError('no such display')", "RuntimeError: no such display"),
        ("import os; os._exit(3)", "trying it ends with status 3"),
        ("print('found: {}')", "trying it ends with status 0"),
        ("while True: pass", "gives no answer within 0.3 s"),
    ],
)
def test_a_driver_that_takes_its_process_down_is_a_reason(monkeypatch, child, reason):
    monkeypatch.setattr(module, "_CHILD", child)
    monkeypatch.setattr(module, "_LONGEST_S", 0.3 if "while" in child else 30.0)
    for cls in METHODS.values():
        found = cls.available()
        assert reason in found
        assert "libegl1 libgl1-mesa-dri" in found
        assert "\n" not in found


@pytest.mark.usefixtures("asked_anew")
def test_without_moderngl_nothing_is_tried(monkeypatch):
    def missing(package):
        raise PackageNotFoundError(package)

    monkeypatch.setattr(module, "version", missing)
    monkeypatch.setattr(module.subprocess, "run", missing)
    assert probe().reason == "moderngl is not installed: pip install 'shadowbench[peers]'"


@needs_opengl
@pytest.mark.usefixtures("asked_anew")
def test_it_is_asked_once_and_names_the_device(monkeypatch):
    asked = []
    run = subprocess.run
    monkeypatch.setattr(module.subprocess, "run", lambda *a, **k: asked.append(a) or run(*a, **k))
    named = [cls.library_versions() for cls in METHODS.values() if cls.available() is None]
    assert len(asked) == 1
    assert named[0] == named[1] == named[2]
    assert named[0]["OpenGL renderer"] == probe().renderer != ""
    assert set(named[0]) == {"moderngl", "OpenGL renderer", "OpenGL"}


def test_listing_the_methods_loads_no_driver():
    check = (
        "import sys; from shadowbench.plugins import Registry; r = Registry();"
        "[c.available() for c in map(r.method, r.names('method')) if c.name.startswith('opengl')];"
        "libraries = open('/proc/self/maps').read() if sys.platform == 'linux' else '';"
        "sys.exit('moderngl' in sys.modules or 'libEGL' in libraries)"
    )
    subprocess.run([sys.executable, "-c", check], check=True)


def test_without_a_driver_the_case_is_skipped_with_the_reason(tmp_path, monkeypatch):
    pytest.importorskip("moderngl", reason="the extra 'peers' is not installed")
    monkeypatch.setenv("GLCONTEXT_LINUX_LIBEGL", NO_EGL)
    ended = carry_out(planned(tmp_path, "opengl-esm", "good"))
    skipped, good = ended.rows
    assert (skipped.outcome, good.outcome) == (Outcome.SKIPPED, Outcome.OK)
    assert NO_EGL in skipped.reason


@needs_opengl
@pytest.mark.usefixtures("lasting_workers")
def test_the_row_names_the_device_and_another_one_is_another_case(tmp_path, monkeypatch):
    (row,) = carry_out(planned(tmp_path, "opengl-shadow-map")).rows
    assert row.outcome is Outcome.OK, row.reason
    assert row.environment["libraries"]["OpenGL renderer"] == probe().renderer
    assert row.failure_percent < 1.0
    monkeypatch.setattr(module, "version", lambda package: "0")
    monkeypatch.setattr(peer, "probe", lambda: Found(renderer="another card", version="9", largest_texture=64))
    assert METHODS["opengl-esm"].library_versions()["OpenGL renderer"] == "another card"


CHILD = """
import hashlib, json, os, sys
from pathlib import Path
import numpy as np
from opengl_peer import METHODS
from surfaces import scattered_receivers, soup, world_of
from tracing import shaded
from shadowbench.device.launch import Context
from shadowbench.scene import DirectionalLight
threads = int(sys.argv[1])
world = world_of(soup(2000, np.random.default_rng(1)), lights={"sun": DirectionalLight((0.4, 1.0, 0.3))})
receivers = scattered_receivers(world, 20_000, np.random.default_rng(2))
allowed = os.sched_getaffinity(0)
digests = []
for cls in METHODS.values():
    method = cls(cls.Parameters(resolution=512), Context(threads=threads))
    for _ in range(3):
        visibility, _ = shaded(method, world, world.lights["sun"], receivers)
        digests.append(hashlib.sha256(visibility.tobytes()).hexdigest())
tasks = [task for task in Path("/proc/self/task").iterdir() if (task / "comm").read_text().startswith("llvmpipe")]
confined = [len(os.sched_getaffinity(int(task.name))) for task in tasks]
print(json.dumps([digests, confined, os.sched_getaffinity(0) == allowed, "LP_NUM_THREADS" in os.environ]))
"""


@needs_opengl
@pytest.mark.skipif(sys.platform != "linux", reason="threads are looked at in /proc")
def test_threads_are_as_many_as_asked_for_and_change_no_bit():
    environment = {k: v for k, v in os.environ.items() if k != "LP_NUM_THREADS"}
    environment["PYTHONPATH"] = str(Path(__file__).parent.parent)
    found = []
    for threads in (1, 2):
        command = [sys.executable, "-c", CHILD, str(threads)]
        ended = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
        digests, confined, is_free_again, is_left_set = json.loads(ended.stdout.splitlines()[-1])
        assert is_free_again
        assert not is_left_set
        if "llvmpipe" in probe().renderer:  # with one thread it draws on the calling one
            assert confined == ([] if threads == 1 else [min(2, len(os.sched_getaffinity(0)))] * 2)
        found.append(digests)
    assert found[0] == found[1]
    assert len(set(found[0])) == 3, "repeats are equal, methods are not"


@needs_opengl
def test_stages_tell_the_transfers_from_the_work():
    rng = np.random.default_rng(1)
    world = world_of(soup(300, rng), lights=LIGHTS)
    receivers = scattered_receivers(world, 100, rng)
    looking_up = ["receiver upload", "look-up", "read-back"]
    method = opengl("esm", resolution=64)
    _, trace = shaded(method, world, world.lights["sun"], receivers)
    assert list(trace.stages) == ["caster upload", "depth map", "convolution", "mip chain", *looking_up]
    assert trace.counters == {"triangles drawn": 302, "map texels": 64 * 64, "look-ups": 100}
    buffers = 12 * (len(world.vertices) + len(world.triangles))
    assert trace.bytes_by_name()["casters on the device"] == buffers
    _, trace = shaded(method, world, world.lights["sun"], receivers, instances=frozenset())
    assert list(trace.stages) == ["depth map", "convolution", "mip chain", *looking_up]
    _, trace = shaded(
        opengl("vsm", resolution=64, kernel=0, filtering="bilinear"), world, world.lights["lamp"], receivers
    )
    assert list(trace.stages) == ["caster upload", "depth map", *looking_up]
    assert trace.counters["map texels"] == 6 * 64 * 64
    assert trace.bytes_by_name()["moment map"] == 6 * 64 * 64 * 8
    _, trace = shaded(opengl("shadow-map", resolution=64), world, world.lights["lamp"], receivers)
    assert list(trace.stages) == ["caster upload", "depth map", *looking_up]
    assert trace.bytes_by_name()["shadow map"] == 6 * 64 * 64 * 4


@needs_opengl
@pytest.mark.parametrize("name", ["shadow-map", "esm", "vsm"])
def test_where_nothing_casts_everything_is_lit(name):
    world = world_of(square(1.0), lights=LIGHTS, casts=(False,))
    receivers = receivers_at(world, np.array([0, 1]), np.array([[0.5, 0.0, 0.5], [0.3, 0.3, 0.4]]))
    method = opengl(name, resolution=64)
    assert (shaded(method, world, world.lights["sun"], receivers)[0] == 1.0).all()
    roofed = world_of(square(1.0), square(1.0, 0.5), lights=LIGHTS)  # also after casters were there
    assert (shaded(method, roofed, roofed.lights["sun"], receivers)[0] < 0.01).any()
    assert (shaded(method, world, world.lights["sun"], receivers)[0] == 1.0).all()


@needs_opengl
def test_what_opengl_reports_is_an_error():
    world = world_of(square(1.0), lights=LIGHTS)
    method = opengl("shadow-map", resolution=64)
    receivers = receivers_at(world, np.array([0]), np.array([[0.5, 0.0, 0.5]]))
    shaded(method, world, world.lights["sun"], receivers)
    with pytest.raises(RuntimeError, match="OpenGL reports GL_INVALID_ENUM"), method._device as device:
        device.gl.enable_direct(1)
    assert shaded(method, world, world.lights["sun"], receivers)[0].shape == (1,)


def test_it_says_what_it_cannot_do(monkeypatch):
    monkeypatch.setattr(peer, "probe", lambda: Found(renderer="a card", version="4.5", largest_texture=4096))
    world = world_of(square(1.0), lights=LIGHTS)
    panel = RectangularLight((0.0, 2.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert "area light" in opengl("esm").supports(world_of(square(1.0), lights={"panel": panel}), panel)
    glass = world_of(square(1.0), lights=LIGHTS, transmittance=(0.5, 0.5, 0.5))
    assert "opaque" in opengl("vsm").supports(glass, glass.lights["sun"])
    assert "at most 4096² texels here, not 8192²" in opengl("esm", resolution=8192).supports(world, world.lights["sun"])
    assert opengl("esm", resolution=4096).supports(world, world.lights["sun"]) is None
