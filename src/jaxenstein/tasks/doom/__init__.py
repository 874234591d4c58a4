"""ViZDoom's own scenarios: Doom's motion in integers, its maps, and its rules tic by tic."""
