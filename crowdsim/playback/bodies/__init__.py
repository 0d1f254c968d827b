"""How bodies are modeled: clothes, heads, hands, shoes, and builds."""
