"""Files: each format has one home, and no file is ever partly written.

format       a file format as a value
atomic       how every file comes into being: written beside its place, checked, then renamed
sandbox      how an untrusted file is read: in a child process, which a damaged file may take down
volumes      OpenVDB: `density`, `vel` and `surface` (its compiled part is openvdb.cpp)
images       OpenEXR: linear pictures and 2-D fields
fields       fields in the plane and in space, by the two above
pictures     8-bit PNG, and what OpenImageIO does with pictures
meshes       PLY of meshes and points; a user's mesh as voxels
mesh_repair  closes a mesh that is not watertight (pymeshlab)
polygons     a user's PLY and OBJ as they stand, and the elements that their vertices make
arrays       named arrays, our own .npz
tracks       element tracks: our own .npz; tables, sequences of meshes and curves of a user's
netcdf       NetCDF 3 and 4: a user's wind or current on latitude and longitude
usd          OpenUSD: one file of a whole animation of elements
video        H.264 and animated WebP
"""
