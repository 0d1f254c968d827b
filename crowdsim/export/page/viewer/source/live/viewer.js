// Names that the viewer of pages shares with this script: both are in one page, and neither holds a copy of the other.

export const {
  show, unpack, ring, Bodies, FileSource, Player, SteeredBodies, faceMaterial, lineMaterial,
  BufferAttribute, BufferGeometry, LineSegments, Mesh, Vector3,
} = globalThis.crowdsimViewer;
