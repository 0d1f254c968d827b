"""Export recordings as 3D scenes: glTF, USD, BVH."""
