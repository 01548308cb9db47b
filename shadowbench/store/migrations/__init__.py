"""Alembic's revisions of the results database; :mod:`shadowbench.store.schema` runs them when a store is opened."""
