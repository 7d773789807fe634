"""Motion field texture synthesis (Ma, Wei, Guo, Zhou 2009: "ma09").

In the order data passes through them:

    strokes       the lines of drawings and SVG documents, and the flow along them (§1)
    exemplar      I, by procedure, from a bitmap, a drawing, a field, a clip (§4)
    coarse        L, simulated, procedural or analytic; and its upsampling (§3, pseudocode 1)
    local_axes    R, the local axes of L, and the coordinate transformation of H (§3.1, §3.3)
    initialize    the first frame (§3.4)
    neighborhood  what is compared (§3.1, §3.3)
    search        the best match of each neighbourhood (§3.1, §3.7)
    assignment    least squares over the matches (§3.1)
    boundary      E_n, the soft boundary condition (§3.6, Eq. 3)
    detail        all of these, level by level and frame by frame (pseudocode 1 and 2)
    views         how 2-D exemplars are seen in 3-D, and their search and assignment (§3.2)
    synthesis_3d  as detail, in three dimensions, from views (§3.2, §3.7)
    potential     as detail, of the potential of H: free of divergence (§3.6, Discussion)
    lagrangian    as detail, at samples that move with the flow (§5)
    quality       measures of a synthesized field
    combine       F = upsample(L) + omega H' (§3.5), and its projection (§3.6)
    density       the smoke that F carries, naive and windowed (supplement A, pseudocode 3 and 4)
    inflate       a volume from 2-D smoke

Notation, as in the paper:

    I  exemplar                L  coarse motion         H  detail, H' after the coordinate transformation
    F  final motion            omega  weight of H'      D  density, O  density under L alone
    m  window, in frames       x_p, z_p  output neighbourhood and its match      E_t  their energy
    R  local axes, as columns  psi  potential, H' = curl psi
    E_n  energy of the boundary, n its normal, b the motion given there, lambda its weight
"""
