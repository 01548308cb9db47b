"""Looking into a case: everything about one of its receivers, and how its parts lie in the world.

::

    finding.py      which row of the results folder a CASE names
    opening.py      a row or a choice of scene, light and camera -> world, receivers, truth, and the method's result
    receiver.py     everything about one pixel's receiver, as plain values
    verdicts.py     why a receiver fails, in words
    space.py        a case laid out in space; drawing.py draws it with pyvista in a child process, page.py writes it as
                    a page, showing.py chooses
    exporting.py    a view as glTF (gltf_writing.py), NPZ and JSON for other programs
    scoring.py      a visibility made elsewhere (visibility_files.py) -> measures, pictures and a row, and
                    kept_visibility.py: itself, so that its case can be opened again

Unlike a run, looking happens in this process, with no clock: a plugin that crashes ends the command.
"""
