"""How films are made: parts of them are drawn and encoded, in processes of their own, and joined."""
