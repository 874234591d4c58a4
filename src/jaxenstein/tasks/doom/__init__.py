"""ViZDoom's own scenarios: Doom's motion in integers, its maps, its rules by the tic."""
