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

The modules: samples (what elements are), mesh (their surfaces).

The exemplars I and coarse motions C: arrangement (points at rest), school (fish), simulation (noodles, paper),
handmade (the same by hand), bundle (threads side by side), scraps (paper in a gust).
"""
