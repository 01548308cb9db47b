"""Where results are kept: a results folder with an SQLite database and the pictures and masks beside it.

::

    <results>/results.sqlite                      runs, rows, and their stages, counters, kept arrays and samples
    <results>/artifacts/<aa>/<sha256>.<suffix>    pictures and masks, named by what is in them

A group's store may have its runs in a PostgreSQL database instead; the models and everything above them are the same.

::

    models.py      the tables, their columns derived from the models of shadowbench.rows
    access_models.py    the tables of tokens, uploads and the audit trail
    derived.py     hashes that rows are grouped by
    records.py     a ResultRow or RunRecord <-> database values
    engine.py      connections, transactions, and database errors as StoreError
    schema.py      the revision of a database: made, upgraded or refused when it is opened
    migrations/    the alembic revisions
    artifacts.py   the content-addressed folder
    inserting.py   rows into the database, many at once
    results.py     Store, which everything else uses
    documents.py   runs and rows as JSON documents, strictly read
    uploads.py     whole runs into the store, and the audit trail
    tokens.py      who may upload
    parquet.py     rows as Parquet, which needs an extra
    transfer.py    runs as one file; backup.py: everything as one file

Reads and writes :mod:`shadowbench.rows` and imports nothing else of the program. The folder must not lie on a network
file system: SQLite's write-ahead log needs memory shared between the processes that have it open.
"""

from __future__ import annotations

from shadowbench.store.results import DATABASE_NAME, Store

__all__ = ["DATABASE_NAME", "Store"]
