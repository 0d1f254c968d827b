"""How a recording lies on the disk: while it is written, and with checksums when it is finished."""
