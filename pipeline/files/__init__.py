"""Files: each format has one home, and no file is ever half there.

atomic      how every file comes into being: written beside its place, checked, then renamed
shelter     how a stranger's file is read: in a child process, which a damaged file may take down
volumes     OpenVDB: `density`, `vel` and `surface` (its compiled part is openvdb.cpp)
images      OpenEXR: linear pictures and 2-D fields
pictures    8-bit PNG, and what OpenImageIO does with pictures
meshes      PLY of meshes and points; a stranger's mesh as voxels
mending     closes a mesh that is not watertight (pymeshlab)
polygons    a stranger's PLY and OBJ as they stand, and the elements that their vertices make
tracks      element tracks: our own .npz; tables, sequences of meshes and curves of a user's
stage       OpenUSD: one file of a whole animation of elements
video       H.264
"""
