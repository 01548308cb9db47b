"""The scenes: one module a scene plugin, found by entry point.

Beside them stand :mod:`~shadowbench.scenes.fitting`, which puts a ground, lights and cameras round one solid, and
:mod:`~shadowbench.scenes.formats`, which reads mesh files. A scene imports those two and never another scene. Every
scene names its lights alike: ``sun`` (directional, the default), ``spot`` (a cone from outside) and ``lamp`` (a point
light near by, which needs all six faces).
"""
