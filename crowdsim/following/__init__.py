"""From path to motion: motion maps and the path follower (Mahmudi and Kallmann 2012)."""
