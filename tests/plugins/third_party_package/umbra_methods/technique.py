"""Shadow below a height: a technique that is right where the scene is a step lit from beside."""

from shadowbench.device.launch import launch
from shadowbench.method import Method
from shadowbench.parameters import ParameterModel, parameter
from umbra_methods.kernels import look_up


class Umbra(Method):
    """Everything below a height is in shadow."""

    name = "umbra"
    title = "Shadow below a height"
    source = "Somebody else"
    counters = {"look-ups": "receivers looked at"}

    class Parameters(ParameterModel):
        height: float = parameter(0.5, unit="scene units", help="Below it lies the shadow.")

    @classmethod
    def library_versions(cls):
        return {"umbra": "1.2"}

    def build(self, casters, light, view, changes, trace):
        with trace.stage("nothing to build"):
            pass

    def shade(self, receivers, visibility, trace):
        with trace.stage("look-up"):
            launch(
                look_up,
                receivers.count,
                inputs=[receivers.on(self.context.device).position, self.parameters.height],
                outputs=[visibility],
                context=self.context,
            )
        trace.count("look-ups", receivers.count)
