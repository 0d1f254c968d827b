"""Walking speeds by age and sex, as guidelines publish them."""

from __future__ import annotations

Row = tuple[str, float, tuple[float, float]]
"""Group of people, its share, and its least and greatest speed on flat floor [m/s], uniformly distributed between."""

POPULATIONS: dict[str, tuple[Row, ...]] = {
    "imo_passengers": (
        ("female, younger than 30", 7.0, (0.93, 1.55)),
        ("female, 30 to 50", 7.0, (0.71, 1.19)),
        ("female, older than 50", 16.0, (0.56, 0.94)),
        ("female, older than 50, mobility impaired (1)", 10.0, (0.43, 0.71)),
        ("female, older than 50, mobility impaired (2)", 10.0, (0.37, 0.61)),
        ("male, younger than 30", 7.0, (1.11, 1.85)),
        ("male, 30 to 50", 7.0, (0.97, 1.62)),
        ("male, older than 50", 16.0, (0.84, 1.40)),
        ("male, older than 50, mobility impaired (1)", 10.0, (0.64, 1.06)),
        ("male, older than 50, mobility impaired (2)", 10.0, (0.55, 0.91)),
    ),
    "imo_crew": (
        ("female", 50.0, (0.93, 1.55)),
        ("male", 50.0, (1.11, 1.85)),
    ),
    "rimea": (
        ("younger than 30", 1.0, (0.58, 1.61)),
        ("30 to 50", 1.0, (1.41, 1.54)),
        ("older than 50", 1.0, (0.68, 1.41)),
        ("mobility impaired", 1.0, (0.46, 0.76)),
    ),
}
"""imo_passengers, imo_crew: IMO MSC.1/Circ.1533, annex 3, appendix 1, tables 3.1 and 3.4. rimea: the table of RiMEA
2.2.1 as in JuPedSim's test 7; the guideline gives no shares, so they are equal."""
