"""Where results are kept: a results folder with an SQLite database and the pictures and masks beside it.

::

    <results>/results.sqlite                      runs, rows, and their stages, counters, kept arrays and samples
    <results>/artifacts/<aa>/<sha256>.<suffix>    pictures and masks, named by what is in them

::

    models.py      the tables, their columns derived from the models of shadowbench.rows
    records.py     a ResultRow or RunRecord <-> database values
    engine.py      connections, transactions, and database errors as StoreError
    schema.py      the revision of a database: made, upgraded or refused when it is opened
    migrations/    the alembic revisions
    artifacts.py   the content-addressed folder
    results.py     Store, which everything else uses

Reads and writes :mod:`shadowbench.rows` and imports nothing else of the program. The folder must not lie on a network
file system: SQLite's write-ahead log needs memory shared between the processes that have it open.
"""

from __future__ import annotations

from shadowbench.store.results import DATABASE_NAME, Store

__all__ = ["DATABASE_NAME", "Store"]
