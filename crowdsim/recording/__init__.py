"""Recordings: one HDF5 file per run; its writer, reader and recovery, and the poses that it shows."""
