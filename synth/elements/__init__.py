"""Dynamic Element Textures (ma13): repeated elements, particles, threads and sheets, that move by example.

    I        exemplar: the elements of a small input
    O        output: the elements that are synthesized
    s        sample, s_i of the exemplar, s_o of the output; an element has one or several
    p(s)     its position, t(s) its time, u(s) = (p, t) both (Eq. 1)
    û(s',s)  u(s') - u(s) (Eq. 2)
    n(s)     neighbourhood: û of the samples near s in space and time (Eq. 3)
    κ        Gaussian falloff with the distance from s, σ_p in space, σ_t in time (Eq. 10)
    N        how many matches predict together (§4.2), with weights ω_j (Eq. 12)
    Θ        constraints of the output (Eq. 5)
    C        coarse motion and shape, D = I - C the details (§5)
    R(s)     local axes at s, q(s) = R(s)ᵀ (p(s) - C(s)) its detail

The modules, in the order data passes through them:

    samples        what elements are: positions over time
    arrangement    exemplars of points at rest
    school         exemplars of fish
    simulation     exemplars of noodles and paper, and C of noodles, by physical simulation
    keyframed      noodles and sheets in drawn motion
    bundle         C of threads: one motion for all, side by side
    falling_paper  C of sheets: paper in a gust
    decomposition  C of elements that were made elsewhere
    orientation    R(s), local axes of samples
    neighborhood   n(s), in space and time
    search         the exemplar samples that are most like each output sample
    constraints    Θ: domain, hard positions
    initialize     the initial output: patches of the exemplar
    assignment     positions by what the matches predict
    collision      the extra solver step
    synthesis      all of it, all frames together or frame by frame
    fidelity       statistics by which an output is compared with its exemplar
    mesh           surfaces of threads, sheets and particles
    fish           how fish swim, and their surfaces
"""
