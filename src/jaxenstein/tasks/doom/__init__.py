"""ViZDoom's own scenarios: Doom's motion in integers, its maps, and its rules tic by tic.

A scenario is a `DoomScenario` made of `Part`s. A part owns some fields of the state, shows its
things, and reads its fields from the running game. `fight` connects monsters, weapons and player.

| topic | modules |
|---|---|
| numbers, motion | `fixed`, `physics`, `slide`, `collision`, `motion`, `pose` |
| maps | `maps`, `free_places`; the files in `maps/`; `text_map` for `tasks.shooter` |
| scenarios | `scenario`, `parts`, `overlay`, and a module for each scenario |
| monsters | `monster_kinds`, `monsters`, `monster_ai`, `monster_attacks`, `respawn` |
| weapons and things | `weapons`, `arsenal`, `projectiles`, `fight`, `items`, `pickups` |
| plain look | `view` |
| `look="game"` | `wad`, `game_look`, `game_scene`, `game_walls`, `game_things`, `game_weapon`, |
| | `monster_looks`, `drops`, `deathmatch_look` |
| `look="random"` | `random_look` |
| scripted players | `players` |

What an addition needs:

- A monster: a row in `monster_kinds`, pictures in `engine/art`, a label in `maps/things.py`; for
  `look="game"` the letters of its pictures in `monster_looks`, and what it drops in `drops`.
- A weapon: a row in `weapons`, and for `look="game"` one in `game_weapon`. For Deathmatch also a
  slot in `SLOTS`, and a row in `items` for the thing that gives it. Deathmatch reads the first five
  of the game's weapon buttons, and only its rocket launcher shoots rockets.
- A wall texture: a row in `view.TEXTURES`.
- A map: `python -m fidelity.doom_map` compares one with the game's; `DoomMap.text` writes it.
- A scenario: its module, its map, and a row in `catalogue.py`.
"""
