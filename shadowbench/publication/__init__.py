"""The published results: a run as pages, tables, pictures and rows that live in a repository, and holding them to it.

::

    folder.py    writes and reads the folder
    pages.py     its pages: what was found, and a page for each experiment
    sheets.py    small pictures side by side
    sample.py    which cases are computed again
    holding.py   computes one again and says what is not as published

A folder holds ``README.md``, ``run.json`` (when, where and with what), and for each experiment a folder with
``README.md``, ``rows.csv`` and pictures; ``visibility/<case key>.png`` are the sampled cases' results, 0 to 255.
"""
