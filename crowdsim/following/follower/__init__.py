"""The path follower: branches laid, tested, scored."""
