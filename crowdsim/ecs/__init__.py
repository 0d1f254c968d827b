"""An entity-component world: columns of arrays, a row an entity."""
