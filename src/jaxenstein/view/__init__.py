"""Pictures for people, drawn on the host with numpy and pillow; nothing here imports jax."""
