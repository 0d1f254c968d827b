"""Fast paths of discs, and the connected components of the places where a disc fits."""
