"""Navigation mesh of one clearance layer: triangulation, clearances, paths of discs of any radius.

The arrays of a mesh, and the names that kernels use for its parts, stand in :mod:`crowdsim.navmesh.mesh.mesh_arrays`.
docs/navmesh.md explains the methods.
"""
