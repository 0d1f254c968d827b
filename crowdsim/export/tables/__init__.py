"""Export tracks as tables: CSV, Parquet, text, and the formats of JuPedSim and Vadere."""
