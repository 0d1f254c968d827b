"""Inverse kinematics of chains of nodes, turned at their joints."""
