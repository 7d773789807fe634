"""The build system: which files a scene needs, which are up to date, and making the others. It knows no method.

In the order data passes through them:

    artifact       one series of files: what it reads, what it is made from, how it is made
    method         what a method hands over: its tables, checks, artifacts and panels
    view           the scene as an artifact may read it: only what it declares
    source_digest  the code that an artifact depends on
    keys           what a key is made of
    manifest       which files are up to date, and what each was made from
    checkpoint     the state that interrupted sequential work goes on from
    graph          all artifacts of a scene: where they are, what is missing, making it
"""
