"""How those who stand give way to those who walk."""
