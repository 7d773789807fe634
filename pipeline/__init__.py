"""Scenes in, figures out: the command line, the stages, the methods, and what keeps their files intact.

In the order data passes through them:

    cli           one command for each thing below; exit codes
    tables        what every scene is written in
    flow          the flow that a scene lives in: coarse motion and obstacles
    methods       the methods there are; each is a folder: `motion` (ma09), `elements` (ma13),
                  `texture` (wang05), `photo` (okabe11)
    scene         a TOML file, checked, as one scene for each variant
    stages        synth, bake, render and figure, in order
    build         which files a scene needs, which are up to date, making the others; knows no method
    figure        panels as one still and one animation
    farm          the stages in batches of frames, each a process
    frame_ranges  ranges of frames, as a farm writes them
    listing       the scenes there are, and which have their figure
    gallery       one page of all figures
    schema        what a scene may hold, for people and for editors
    references    what a scene gives, kept
    diff          whether it still gives that
    diff_report   what differs, to look at
    doctor        what this machine has of what a render needs
    progress      how far long work is
    errors        what can go wrong, and the exit code of each

and `pipeline.files`, the one home of each file format.
"""
