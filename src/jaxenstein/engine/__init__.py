"""The renderer: levels, rays, walls, sprites and textures. It knows no task."""
