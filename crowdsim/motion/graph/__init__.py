"""The motion graph: features, nodes, transitions, poses."""
