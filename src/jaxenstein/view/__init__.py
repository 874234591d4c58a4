"""Pictures for people, drawn on the host with numpy and pillow."""
