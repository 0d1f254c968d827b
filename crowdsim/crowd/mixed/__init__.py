"""Both levels of locomotion in one crowd: who is on which, and how characters go over."""
