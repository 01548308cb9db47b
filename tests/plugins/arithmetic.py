"""One piece of arithmetic under two names, and the same with three in a hundred more of it.

To be told from itself, or found slower: by its times only, since the visibility is the same.
"""

import warp as wp

from shadowbench.device.launch import kernel_options, launch
from shadowbench.method import Method
from shadowbench.parameters import ParameterModel, parameter

wp.set_module_options(kernel_options())


@wp.kernel
def iterate(first: wp.int32, steps: wp.int32, visibility: wp.array[wp.float32]):
    receiver = wp.tid() + first
    state = wp.uint32(receiver)
    for _step in range(steps):
        state = state * wp.uint32(1664525) + wp.uint32(1013904223)  # Knuth's generator: each step needs the one before
    lit = wp.float32(1.0)
    if state == wp.uint32(0):
        lit = wp.float32(0.0)
    visibility[receiver] = lit


class _Arithmetic(Method):
    """Everything is lit, after some arithmetic."""

    title = "Arithmetic"

    class Parameters(ParameterModel):
        steps: int = parameter(800, unit="steps", help="Of the generator, for every receiver.", ge=1, le=1_000_000)
        number: int = parameter(1, unit="1", help="Makes cases different.", ge=1, le=1_000_000)

    def build(self, casters, light, view, changes, trace):
        pass

    def shade(self, receivers, visibility, trace):
        with trace.stage("arithmetic"):
            launch(iterate, receivers.count, [self.parameters.steps], [visibility], context=self.context)


class Here(_Arithmetic):
    """The arithmetic."""

    name = "here"


class There(_Arithmetic):
    """The same arithmetic."""

    name = "there"


class Free(_Arithmetic):
    """Everything is lit, at once."""

    name = "arithmetic-free"

    def shade(self, receivers, visibility, trace):
        visibility.fill_(1.0)
