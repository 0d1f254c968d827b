"""Requirements of a query, behavior areas, lower bound."""
