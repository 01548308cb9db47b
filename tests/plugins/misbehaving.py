"""Methods that each break in one way."""

import ctypes
import os
import signal
import sys
import time

import numpy as np

from shadowbench.method import Method
from shadowbench.parameters import ParameterModel, parameter


class _Lit(Method):
    """Everything is lit."""

    title = "Lit, but"

    def build(self, casters, light, view, changes, trace):
        pass

    def shade(self, receivers, visibility, trace):
        visibility.fill_(1.0)
        trace.count("receivers", receivers.count)


class Raises(_Lit):
    name = "raises"

    def build(self, casters, light, view, changes, trace):
        print("a word before the end")
        raise ValueError("no tree could be built\nsecond line")


class Told(_Lit):
    """Behaves, and counts what it is told of."""

    name = "told"

    def build(self, casters, light, view, changes, trace):
        trace.count("instances moved", len(changes.instances))
        trace.count("light moved", int(changes.light))
        trace.count("view moved", int(changes.view))


class RaisesLater(_Lit):
    name = "raises-later"
    frames = 0

    def shade(self, receivers, visibility, trace):
        super().shade(receivers, visibility, trace)
        self.frames += 1
        if self.frames > 4:
            raise RuntimeError("tired")


class Exits(_Lit):
    name = "exits"

    def build(self, casters, light, view, changes, trace):
        os._exit(7)


class ExitsPolitely(_Lit):
    name = "exits-politely"

    def build(self, casters, light, view, changes, trace):
        sys.exit("enough")


class Segfaults(_Lit):
    name = "segfaults"

    def shade(self, receivers, visibility, trace):
        ctypes.string_at(0)


class WritesToReceivers(_Lit):
    name = "writes-to-receivers"

    def shade(self, receivers, visibility, trace):
        receivers.on("cpu").position.fill_(0.0)


class Aborts(_Lit):
    name = "aborts"

    def shade(self, receivers, visibility, trace):
        os.abort()


class Loops(_Lit):
    name = "loops"

    def shade(self, receivers, visibility, trace):
        while True:
            pass


class LoopsInC(_Lit):
    """Holds the interpreter lock and ignores what may be ignored."""

    name = "loops-in-c"

    def shade(self, receivers, visibility, trace):
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGABRT, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        (10**8) ** (10**7)


class Starts(_Lit):
    """Leaves a process of its own behind."""

    name = "starts-a-process"

    def shade(self, receivers, visibility, trace):
        if os.fork() == 0:
            time.sleep(1000)
        while True:
            time.sleep(1)


class Allocates(_Lit):
    name = "allocates"

    def shade(self, receivers, visibility, trace):
        kept = []
        while True:
            kept.append(np.ones(4 << 20))


class AllocatesAtOnce(_Lit):
    name = "allocates-at-once"

    def shade(self, receivers, visibility, trace):
        np.empty(1 << 55)


class Nan(_Lit):
    name = "nan"

    def shade(self, receivers, visibility, trace):
        visibility.numpy()[:] = 1.0
        visibility.numpy()[5:8] = np.nan


class Unwritten(_Lit):
    name = "unwritten"

    def shade(self, receivers, visibility, trace):
        visibility.numpy()[10:] = 1.0


class OutOfRange(_Lit):
    name = "out-of-range"

    def shade(self, receivers, visibility, trace):
        visibility.fill_(1.5)


class Fickle(_Lit):
    name = "fickle"
    frames = 0

    def shade(self, receivers, visibility, trace):
        visibility.fill_(1.0)
        self.frames += 1
        visibility.numpy()[: self.frames] = 0.0


class FickleAllowed(Fickle):
    name = "fickle-allowed"
    deterministic = False


class FickleCounter(_Lit):
    name = "fickle-counter"
    frames = 0

    def shade(self, receivers, visibility, trace):
        super().shade(receivers, visibility, trace)
        self.frames += 1
        trace.count("frames", self.frames)


class WrongMask(_Lit):
    name = "wrong-mask"

    def explain(self, receivers, trace):
        trace.mask("classified", np.ones(3))


class WrongPicture(_Lit):
    name = "wrong-picture"

    def explain(self, receivers, trace):
        trace.heat("heat", np.ones((receivers.count, 2)))


class Unsupporting(_Lit):
    name = "unsupporting"

    def supports(self, world, light):
        return "it likes no light"


class Unavailable(_Lit):
    name = "unavailable"

    @classmethod
    def available(cls):
        return "needs a library that nobody has"


class CudaOnly(_Lit):
    name = "cuda-only"
    devices = frozenset({"cuda"})


class Watchful(_Lit):
    name = "watchful"

    class Parameters(ParameterModel):
        every_frame: bool = parameter(False, unit="1", help="Whether it builds for every frame.")

    def is_view_dependent(self):
        return self.parameters.every_frame

    def explain(self, receivers, trace):
        trace.heat("left to right", receivers.pixel % receivers.width)


class Good(_Lit):
    name = "good"

    @classmethod
    def library_versions(cls):
        return {"imagined": os.environ.get("IMAGINED_VERSION", "1")}

    class Parameters(ParameterModel):
        level: int = parameter(1, unit="1", help="Makes cases different.", ge=0, le=100)


class FickleProcess(_Lit):
    name = "fickle-process"

    def shade(self, receivers, visibility, trace):
        super().shade(receivers, visibility, trace)
        visibility.numpy()[os.getpid() % receivers.count] = 0.0


class CountsProcesses(_Lit):
    name = "counts-processes"

    def build(self, casters, light, view, changes, trace):
        trace.count("process", os.getpid())


class FickleProcessAllowed(FickleProcess):
    name = "fickle-process-allowed"
    deterministic = False


class FailsAgain(_Lit):
    name = "fails-again"
    """Works in the first process that loads it."""

    def __init__(self, parameters, context):
        super().__init__(parameters, context)
        mark = os.environ["FAILS_AGAIN_MARK"]
        if os.path.exists(mark):
            raise RuntimeError("once was enough")
        open(mark, "w").close()


class Remembers(_Lit):
    name = "remembers"

    class Parameters(ParameterModel):
        megabytes: int = parameter(1, unit="MiB", help="What it keeps.", ge=1, le=1000)

    def __init__(self, parameters, context):
        super().__init__(parameters, context)
        self.kept = np.ones(parameters.megabytes << 20, np.uint8)

    def build(self, casters, light, view, changes, trace):
        trace.keep("nothing much", self.kept)
