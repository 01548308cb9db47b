"""The results service: everybody's runs in one place, as pages, JSON and CSV.

::

    settings.py     what an operator decides
    app.py          the application: middleware, routes, errors
    serving.py      the process: workers, signals, logs
    access.py       tokens and scopes; buckets.py: how often one may ask
    bodies.py       request bodies, read within limits; strictly validated uploads
    keeping.py      uploads kept, in a process beside the one that serves
    pictures.py     PNG files decoded within limits and encoded again
    headers.py      security headers and content policies
    problems.py     errors as problem+json (RFC 9457) or as a page
    answers.py      what each page says, as JSON values and CSV lines
    standings.py    leaderboards; histories.py: a method over time
    responding.py   an answer as page, JSON or CSV, with its ETag, kept while the store does not change
    reports.py      reports of runs, made once
    pages.py        routes for readers; uploads.py: routes for uploading; documentation.py: the API's own page
    schemas.py      what travels, as the API describes it
    rendering.py    templates, style and script
    site.py         all pages as files, for a web server that runs nothing
    telemetry.py    counters for Prometheus, structured logs
    client.py       the other side: ``shadowbench push``
    templates/ static/

Imports no Warp and no plugin. Uploaded text is escaped wherever it is shown, uploaded pictures are encoded anew before
they are sent, and nothing uploaded is ever run.
"""
