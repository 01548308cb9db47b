"""The scenes: one module a scene plugin, found by entry point.

Beside them stand :mod:`~shadowbench.scenes.fitting`, which puts a ground, lights and cameras round one solid, and
:mod:`~shadowbench.scenes.formats` with :mod:`~shadowbench.scenes.standing`, which read mesh files and set them upright.
A scene imports those and never another scene. Every scene names its lights alike: ``sun`` (directional, the default),
``spot`` (a cone from outside) and ``lamp`` (a point light near by, which needs all six faces).
"""
