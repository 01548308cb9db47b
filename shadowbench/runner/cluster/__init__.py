"""A run on other machines: comparisons handed to the workers of a dask.distributed cluster.

::

    access.py        the optional package, addresses, TLS                  both
    jobs.py          what client and worker say to each other              both
    fingerprint.py   digests of the code that a worker must have too       both
    handing.py       whom to give what, deaths, rows into the store        client
    comrades.py      which workers there are, and which may measure        client
    serving.py       the dask worker: takes jobs, passes messages on       worker
    bench_process.py the process that measures; its cases are its children worker
    host_lock.py     one job at a time a machine                           worker
    starting.py      shadowbench worker, shadowbench scheduler             worker, scheduler

The client plans, hands out, and alone writes the store. A *job* is what is left of one comparison, so that interleaved
cases stay on one machine. The dask worker measures nothing itself: it starts a process that does what a local run
does, with the same code, and passes rows and pictures on as they come. A plugin may kill that process, its parent: the
job then ends as *died*, and the worker lives on. Killing the dask worker, or its machine, ends the job in the same way.

Dask places nothing: every job is pinned to one worker and never retried by dask, since only the client knows which
rows it has. One job at a time is in flight for each worker, so that a long sweep is not submitted at once and a worker
that joins late gets the next job.
"""
