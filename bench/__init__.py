"""What `make bench` runs: our speed and quality beside references, peers and the papers' own figures.

Each module measures one thing in a process of its own and prints one JSON object; `python -m bench` runs them
all, prints tables and writes out/bench.json.

    machine      what it is all measured on
    flows        the coarse motions L of the tables
    synthesis    ma09 2-D: time, memory, and times faster than the reference
    reference    the same synthesis in plain NumPy and SciPy
    search       the exact search beside FAISS
    density      the density window beside SciPy
    repeat       the same bits: run after run, at any thread count, from any kernel cache
    solid        ma09 3-D: time, memory, growth, quality of both searches
    smoke        a frame of smoke: path-traced draft, march, and Cycles
    quality      five numbers and whole motifs for every built-in exemplar, and what helped
    boundary     what flows through the wall of figure 7, and what observing it costs the texture
"""
