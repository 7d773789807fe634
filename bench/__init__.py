"""What `make bench` runs: our speed and quality beside references, peers and the papers' own figures.

Each part measures one thing in a process of its own and prints one JSON object; `python -m bench` runs them all,
prints tables, writes each part's section of bench/RESULTS.md, and out/bench.json.

    machine      what it is all measured on, and the revision
    flows        the coarse motions L of the tables
    plot         curves as an SVG
    fluid        measures of a picture that flows: its look, its motion, its pieces, its loop

    synthesis    ma09 2-D: time, memory, and the speed-up over the reference
    reference    the same synthesis in plain NumPy and SciPy
    search       the exact search beside FAISS
    density      the density window beside SciPy
    repeat       the same bits: run after run, at any thread count, from any kernel cache
    solid        ma09 3-D: time, memory, growth, quality of both searches
    smoke        a frame of smoke: path-traced draft, ray march, and Cycles
    quality      five numbers and whole motifs for every built-in exemplar, and what each step gains
    boundary     what flows through the wall of figure 7, and what observing it costs the texture
    potential    ma09 §3.6: a potential synthesized instead of the motion
    lagrangian   ma09 §5: detail at samples that move, beside detail on a grid
    elements     ma13: time, memory, growth, exemplars in their own domain, jitter
    fidelity     ma13: statistics of every scene beside those of its exemplar
    texture      wang05: likeness to the sample, motion, time, growth, memory, and rlic beside it
    loops        wang05: how the last frame of a loop leads into the first
    photo        okabe11: look, motion and loop, truth, minimizers, time, memory, the same bits
    subjects     okabe11: targets on which the method was not tuned

    targets      rows of each part: the measured number, its target, the paper's or a peer's number
    results      the rows as Markdown, in the part's own section of RESULTS.md
"""
