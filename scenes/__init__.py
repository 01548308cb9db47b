"""The scenes: one module a scene plugin, found by entry point.

Beside them stand :mod:`~shadowbench.scenes.fitting`, which puts a ground, lights and cameras round one solid;
:mod:`~shadowbench.scenes.formats` with :mod:`~shadowbench.scenes.standing`, which read mesh files and set them upright;
and what scenes are built from: ``vectors``, ``shapes``, ``tubes``, ``uniform_draws``, then ``plants``, ``trees``,
``sunflowers``, ``masonry``, ``furniture``, ``house``, and ``setting``, which gathers them. A scene imports those and
never another scene, and nothing that machines round differently decides where a vertex lies.

Every scene names its lights alike: ``sun`` (directional, the default), ``spot`` (a cone from outside) and ``lamp`` (a
point light near by, which needs all six faces).
"""
