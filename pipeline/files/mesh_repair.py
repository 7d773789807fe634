"""The one home of pymeshlab (GPL-3), which closes meshes that are not watertight. Nothing else of flowloom needs it."""

from __future__ import annotations

import numpy as np

LARGEST_HOLE = 100_000  # edges round it


def closed(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A mesh (N, 3), (M, 3) with its holes closed, no face twice, no edge of more than two faces, turned one way round.

    Runs in a child process (`sandbox`), like all that touches a user's mesh. It need not succeed: the caller looks
    whether the result is watertight. Raises ValueError where there is nothing to repair.
    """
    try:
        import pymeshlab
    except ImportError as error:  # it is linked with a library of windows and screens
        raise ValueError(f"is not watertight, and pymeshlab cannot be loaded to repair it ({error})") from error
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(np.asarray(vertices, np.float64), np.asarray(faces, np.int32)))
    try:
        meshes.meshing_merge_close_vertices()
        meshes.meshing_remove_duplicate_faces()
        meshes.meshing_remove_null_faces()
        meshes.meshing_repair_non_manifold_edges()
        meshes.meshing_repair_non_manifold_vertices()
        meshes.meshing_close_holes(maxholesize=LARGEST_HOLE, newfaceselected=False)
        meshes.meshing_re_orient_faces_coherently()
    except (pymeshlab.PyMeshLabException, AttributeError) as error:  # a plug-in did not load: no such filter
        raise ValueError(f"is not watertight and cannot be repaired: {str(error).splitlines()[-1]}") from error
    repaired = meshes.current_mesh()
    return np.asarray(repaired.vertex_matrix(), np.float64), np.asarray(repaired.face_matrix(), np.int64)
