"""A web page in one file that plays a recording in any browser."""
