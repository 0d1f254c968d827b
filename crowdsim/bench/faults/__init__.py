"""Fault injection: random edits, damaged files and killed runs, and how crowdsim handles them."""
