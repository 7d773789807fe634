"""Scenes in, figures out: the command line, the stages, and what keeps their files whole.

In the order data passes through them:

    cli              one command for each thing below; exit codes
    schema           the tables and keys of a scene
    elements_schema  those of a scene of elements
    scene            a TOML file, checked, as one scene for each variant
    stages           which products are not whole, and making them: synth, bake, render, figure
    product          what a product is: a series of files, and what its content depends on
    sources          the code that a product depends on
    obstacles        synth: the solids in the flow
    fields           synth: exemplar, L and H
    guides           synth: what guides elements: domain, flow, orientation, maps, hard positions
    elements         synth: exemplar, C and the output of a scene of elements
    geometry         bake: F and the density
    looks            bake and render: meshes and pictures of elements
    panels           render: the smoke, and pictures of the fields
    figure           figure: panels as one still and one animation
    manifest         which files are whole, and what each was made from
    farm             the stages in batches of frames, each a process
    frames           ranges of frames, as a farm writes them
    listing          the scenes there are, and which have their figure
    gallery          one page of all figures
    references       what a scene gives, kept
    diff             whether it still gives that
    evidence         what differs, to look at
    doctor           what this machine has of what a render needs
    progress         how far long work is
    errors           what can go wrong, and the exit code of each

and `pipeline.files`, the one home of each file format.
"""
